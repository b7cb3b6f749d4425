"""Fit the models and competitors of a study with the settings of its spec, and divide its data into
the folds of a cross-validation.
"""
