"""Search the structure of a model: candidates are declared as data, and one rule chooses."""
