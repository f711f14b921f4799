"""Import of a user's log as a record: its map, its files, its clock, and plausibility checks."""
