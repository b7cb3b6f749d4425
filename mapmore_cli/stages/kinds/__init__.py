"""From sections of the spec to models: one file for each kind of model."""
