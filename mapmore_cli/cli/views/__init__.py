"""Results as people and scripts see them: each kind of result as a JSON document and as tables."""
