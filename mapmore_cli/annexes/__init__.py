"""Provide the parts that a study does not need. Each registers itself like a plugin."""
