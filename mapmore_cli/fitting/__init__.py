"""Make models, competitors and folds from the sections of a spec."""
