"""How far models lie from measurements: metrics, the rows of the score table, repeatability as the
floor.
"""
