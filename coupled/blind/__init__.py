"""Blind trials: sealed records from an independent twin of the rig, and scores of their diagnoses."""
