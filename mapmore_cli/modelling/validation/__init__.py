"""Compare models with measurements: compute errors, intervals and repeatability."""
