"""Results of commands as single HTML files."""
