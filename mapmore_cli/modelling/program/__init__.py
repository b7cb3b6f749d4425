"""Represent a model as statements that compute its output from the inputs of one sample."""
