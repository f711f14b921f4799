"""A user's own log made a record: its map, its files, its clock, and whether it can be true."""
