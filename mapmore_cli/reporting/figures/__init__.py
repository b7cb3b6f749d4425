"""Draw the figures of the report: choose the data, draw them on axes, and write the figure as
SVG.
"""
