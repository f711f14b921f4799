"""Stability: where the loader, its host and the hand begin to oscillate or to run away."""
