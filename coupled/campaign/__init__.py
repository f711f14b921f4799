"""Many flights: expectations checked, and parameters swept."""
