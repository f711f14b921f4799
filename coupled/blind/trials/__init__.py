"""Sealed trials: drawn, simulated, answered and scored."""

NEWEST = 5  # version of the trials
