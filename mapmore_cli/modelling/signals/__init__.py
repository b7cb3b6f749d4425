"""Compute with sampled signals: rates, levels, load cycles, gaps, plateaus."""
