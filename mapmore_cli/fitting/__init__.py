"""From the sections of a spec to models, competitors and folds."""
