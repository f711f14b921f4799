"""Figures: the only room that imports matplotlib. Angles are drawn in degrees."""
