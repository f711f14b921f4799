"""Control authority: configurations compared, loss maps, and stability."""
