"""Fit models whose output has a known shape, for example a force that rises with the pressure."""
