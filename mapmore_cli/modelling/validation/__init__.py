"""Measure how far models lie from measurements: metrics, intervals, repeatability."""
