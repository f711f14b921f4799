"""The noise of a channel: its level, its colour and its spectral lines."""
