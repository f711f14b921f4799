"""The tables of results, used by the terminal, HTML and notebooks."""
