"""Sealed trials: drawn, made, sized, answered and scored."""

NEWEST = 4  # version of the trials
