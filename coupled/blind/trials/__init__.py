"""Sealed trials: drawn, made, sized, answered and scored."""

NEWEST = 5  # version of the trials
