"""From the sections of a spec to models: the makers of every kind, what is compared with them,
folds and the search.
"""
