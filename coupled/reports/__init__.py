"""A command's result as one HTML file that a colleague can be handed."""
