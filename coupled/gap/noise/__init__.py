"""What of a channel is noise: its level, its colour, its lines."""
