"""The page in the browser: a process of its own, so that nothing it does makes a frame late."""
