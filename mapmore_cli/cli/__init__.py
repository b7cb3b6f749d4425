"""Define the commands. Each command parses its arguments, calls functions of the other packages,
which do the work, and prints the result.
"""
