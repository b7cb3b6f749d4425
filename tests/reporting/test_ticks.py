"""Ticks as one artist are drawn as Matplotlib's own are, dot by dot."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from mapmore_cli.reporting.figures.style import figure_style
from mapmore_cli.reporting.figures.ticks import POINTS, Ticks, name_ticks


def linear(ax):
    ax.plot([-3, 4], [0.1, 0.7])


def factors(ax):
    ax.plot([2e7, 9e7], [-5e-8, 3e-8])


def offsets(ax):
    ax.plot([100000.1, 100000.3], [1, 2])


def logarithmic(ax):
    ax.plot([0.02, 60], [3, 500])
    ax.set_xscale("log")
    ax.set_yscale("log")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())


def upside_down(ax):
    ax.plot([0, 1], [0, 2])
    ax.set_ylim(2.5, -0.5)


def named(ax):
    ax.plot([1, 5], [0, 2])
    name_ticks(ax.yaxis, range(3), ["one", "two\nlines", "a much longer name"])
    ax.tick_params(axis="y", length=0)


def without_numbers(ax):
    ax.plot([1, 5], [0, 2])
    ax.tick_params(labelbottom=False, labelleft=False)


LOOKS = [linear, factors, offsets, logarithmic, upside_down, named, without_numbers]


def axes_with(look):
    figure = Figure(figsize=(3, 2), dpi=POINTS)
    FigureCanvasAgg(figure)
    ax = figure.add_axes((0.3, 0.3, 0.5, 0.5))
    look(ax)
    return figure, ax


def dots(figure):
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())


@pytest.mark.parametrize("look", LOOKS)
def test_every_dot_is_that_of_an_axis(look):
    with figure_style():
        figure, ax = axes_with(look)
        for axis in (ax.xaxis, ax.yaxis):
            ticks = Ticks(axis)
            ticks.decide()
            ticks.measured(RendererBase())
        plain, _ = axes_with(look)
        np.testing.assert_array_equal(dots(figure), dots(plain))
        bare, ax = axes_with(look)
        ax.set(xticks=[], yticks=[])
        assert (dots(bare) != dots(plain)).any()


@pytest.mark.parametrize("look", LOOKS)
def test_numbers_are_measured_as_they_are_drawn(look):
    with figure_style():
        _, ax = axes_with(look)
        found = []
        for axis in (ax.xaxis, ax.yaxis):
            ticks = Ticks(axis)
            ticks.decide()
            found.append(ticks.measured(RendererBase()).extents)
        _, plain = axes_with(look)
        plain.figure.canvas.draw()
        for axis, box in zip((plain.xaxis, plain.yaxis), found, strict=True):
            low, high = sorted(axis.get_view_interval())
            labels = [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high and tick.label1.get_visible()]
            boxes = [plain.get_window_extent(), *(label.get_window_extent(RendererBase()) for label in labels)]
            corners = np.array([one.extents for one in boxes])
            np.testing.assert_allclose(box, [*corners[:, :2].min(axis=0), *corners[:, 2:].max(axis=0)])
