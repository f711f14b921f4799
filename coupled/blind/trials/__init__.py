"""Sealed trials: drawn, made, sized, answered and scored."""
