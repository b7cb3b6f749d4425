"""A model as a program: statements that compute its output from one sample's inputs (an
intermediate representation).
"""
