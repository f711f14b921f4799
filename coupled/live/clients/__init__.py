"""Reference clients of the open protocol, to be copied: they do not import this package."""
