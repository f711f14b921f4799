"""Stability limits of loader, host and hand: oscillation and divergence."""
