"""Figures of the report: data chosen, drawn on given axes, saved as SVG."""
