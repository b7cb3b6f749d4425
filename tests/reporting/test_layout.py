"""The places of panels: labels lie on the page, cover no other panel and stand in line; panels are of one size."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backend_bases import RendererBase

from mapmore_cli.domain.page import FIGURES
from mapmore_cli.reporting.figures.catalogue import drawings
from mapmore_cli.reporting.figures.drawing import POINTS, compose
from mapmore_cli.reporting.figures.style import figure_style

NAMES = [name for name in FIGURES if name not in ("loops", "motion", "convergence")]  # of models with memory


def boxes(figure):
    """What every panel covers with its labels, in points."""
    return [ax.get_tightbbox(RendererBase(), for_layout_only=True).extents for ax in figure.axes]


@pytest.mark.parametrize("name", NAMES)
def test_no_label_leaves_the_page_or_lies_on_another_panel(name, mixed):
    with figure_style():
        for drawing in drawings(name, mixed):
            figure = compose(drawing)
            width, height = figure.get_size_inches() * POINTS
            top = min((legend.get_window_extent(RendererBase()).y0 for legend in figure.legends), default=height)
            found = boxes(figure)
            for left, low, right, high in found:
                assert -0.1 <= left < right <= width + 0.1
                assert -0.1 <= low < high <= top + 0.1
            for one, other in combinations(found, 2):
                assert one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]


def test_panels_are_of_one_size_and_their_labels_in_line(inputs):
    with figure_style():
        figure = compose(drawings("fit", inputs)[0])
        panels = [ax.get_window_extent() for ax in figure.axes]
        assert np.ptp([panel.width for panel in panels]) < 1e-6
        assert panels[0].height == pytest.approx(2 * panels[1].height)
        boxes(figure)
        labels = [ax.yaxis.label.get_window_extent(RendererBase()).x0 for ax in figure.axes if ax.get_ylabel()]
        assert len(labels) >= 2
        assert np.ptp(labels) < 0.1
