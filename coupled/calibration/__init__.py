"""The bench procedure: readings, their fit with errors, a virtual bench, the documentation."""
