"""Decide what to measure next: the next level, or the next points of a map."""
