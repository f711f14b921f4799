"""Inputs of users that failed: what is printed for each, and what is right."""
