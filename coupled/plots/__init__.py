"""Figures. Only this package imports matplotlib. Angles are drawn in degrees."""
