"""Fit models and competitors, and make the folds of cross-validations, from the sections of a
spec.
"""
