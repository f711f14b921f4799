"""A first map of an unknown log, from names, units and sizes; what they leave open is asked."""
