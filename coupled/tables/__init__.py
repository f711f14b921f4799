"""The tables of results: one function for each, which the terminal, HTML and notebooks show."""
