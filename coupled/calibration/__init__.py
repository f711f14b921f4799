"""Calibration: readings, their fit with errors, a simulated bench, and force documentation."""
