"""Search the structure of a model: candidates declared as data, and one rule."""
