"""Do many runs at once."""
