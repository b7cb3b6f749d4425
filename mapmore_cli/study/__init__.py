"""The experiment spec: models, strict loading with positions, overrides, JSON Schema."""
