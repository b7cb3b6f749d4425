"""Pure functions of sampled signals: rates, repeated time stamps, levels, load cycles."""
