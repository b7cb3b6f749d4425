"""Draw the figures of the report: choose data, draw on given axes, save as SVG."""
