"""The bench procedure: readings, their fit with errors, the virtual bench, and the documentation."""
