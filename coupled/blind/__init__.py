"""Blind trials: sealed records of an independent twin of the rig, and their scores."""
