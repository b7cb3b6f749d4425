"""The structures that a search tries, and what it knows of the data before it does; which is taken
is `choice`'s.
"""
