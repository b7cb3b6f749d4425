"""One module for each formula of the literature; the module's name is the formula's, its `FORMULA`
is the formula.
"""
