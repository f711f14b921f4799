"""The page in the browser, in a process of its own, so that it does not delay frames."""
