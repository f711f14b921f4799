"""A first map of an unknown log, from names, units and sizes, with questions for the rest."""
