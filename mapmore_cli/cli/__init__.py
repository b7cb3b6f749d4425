"""Define the commands: each parses its arguments, calls one function of a lower layer, and prints
the result.
"""
