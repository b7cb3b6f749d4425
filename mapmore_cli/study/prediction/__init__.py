"""Predictions for tables: their records, and the stretches of them that belong together."""
