"""The way between the levels, drawn as weights where there are weights to draw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from report_builder import of_pieces

from mapmore_cli.modelling.kinds import predict
from mapmore_cli.reporting.figures.catalogue import drawings
from mapmore_cli.reporting.figures.levels import draw_courses, draw_levels, level_courses, level_figures, level_weights

LEVELS = np.array([80.0, 150.0, 350.0])


@pytest.fixture
def ax():
    return Figure().subplots()


@pytest.fixture
def shaped(inputs):
    """The same study with shape-preserving interpolation between the levels."""
    return replace(inputs, model=of_pieces(inputs.model, fusion=replace(inputs.model.body.fusion, levels="pchip")))


def test_triangles_peak_at_the_levels(ax, inputs):
    draw_levels(ax, LEVELS, *level_weights(inputs.model.body, LEVELS))
    for line, level in zip(ax.lines[::2], LEVELS, strict=True):
        x, weight = line.get_data()
        assert weight[x == level] == pytest.approx([1.0])
    assert ax.lines[0].get_xdata().max() > 350


def test_a_number_beyond_the_levels_is_not_drawn(ax, inputs):
    fusion = replace(inputs.model.body.fusion, extrapolation={"pressure": (100.0, "saturate"), "strain": ("continue", "continue")})
    draw_levels(ax, LEVELS, *level_weights(replace(inputs.model.body, fusion=fusion), LEVELS))
    assert ax.lines[0].get_xdata().min() == 80


def test_no_triangles_are_drawn_of_what_keeps_the_shape(inputs, shaped):
    (triangles,), (courses,) = level_figures(inputs), level_figures(shaped)
    assert triangles.panels[0].y_labels[0] == "Weight (–)"
    assert courses.panels[0].y_labels[0] == "Force (N)"
    assert "Weights" in triangles.caption
    assert "no single weight" in courses.caption


def test_courses_are_the_models_predictions_within_the_range_of_all_curves(ax, shaped):
    courses = level_courses(shaped.model, "strain", LEVELS)
    shortest = min(curve.limits["strain"][1] for curve in shaped.model.body.curves)
    for course in courses:
        assert 0 < course.place < shortest
        at = {"pressure": course.x, "strain": np.full(len(course.x), course.place)}
        np.testing.assert_array_equal(course.y, predict(shaped.model, at))
        np.testing.assert_array_equal(course.at_levels, course.y[np.isin(course.x, LEVELS)])
    draw_courses(ax, courses, LEVELS)
    assert len(ax.lines) == 2 * len(courses)


def test_one_level_has_no_way_to_draw(alone):
    assert level_figures(alone) == []
    assert [drawing.name for drawing in drawings("segments", alone)] == ["segments"]
