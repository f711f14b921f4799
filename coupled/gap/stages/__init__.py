"""Each stage's residual: what is measured, less what the stage makes of its measured input."""
