"""Pure functions of sampled signals: rates, repeated time stamps, levels, load cycles, strokes,
gaps, plateaus, directions.
"""
