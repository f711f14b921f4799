"""A record: named channels with their units over time, and the files that hold it."""
