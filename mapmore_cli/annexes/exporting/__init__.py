"""Models in other languages: C, functional mock-up units, TeX, NumPy. Written from terms and
weights, never from the fit.
"""
