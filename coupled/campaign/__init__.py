"""Many flights at once: expectations checked, and parameters swept."""
