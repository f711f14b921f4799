"""The front door: what `coupled` offers in Python. Thin: each function calls one room."""
