"""Reference clients of the open protocol, to be copied: they need nothing of this package."""
