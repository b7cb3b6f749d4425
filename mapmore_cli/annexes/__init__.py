"""Provide the optional parts of the program, for example exports and the structure search. Each
part registers itself like a plugin.
"""
