"""The rules of `mapmore check`, which every run applies as well: what the data say about themselves
and about their spec.
"""
