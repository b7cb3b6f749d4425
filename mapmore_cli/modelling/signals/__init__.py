"""Pure functions of sampled signals: rates, levels, load cycles, gaps, plateaus."""
