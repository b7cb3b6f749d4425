"""Provide the parts without which a study can do. Each adds itself in the way of a plugin."""
