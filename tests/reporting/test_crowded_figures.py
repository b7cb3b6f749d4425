"""Figures of many levels, quantities and inputs; the places of panels."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backend_bases import RendererBase
from report_builder import of_pieces

from mapmore_cli.reporting.figures import data, residuals
from mapmore_cli.reporting.figures.drawing import compose, drawings
from mapmore_cli.reporting.figures.segments import level_figures
from mapmore_cli.reporting.figures.style import figure_style


def drawing(inputs, name):
    with figure_style():
        return next(
            found for found in drawings(name.partition("_")[0], inputs) if found.name == name
        )


def boxes(figure):
    """What every panel covers with its labels, in points."""
    return [ax.get_tightbbox(RendererBase(), for_layout_only=True).extents for ax in figure.axes]


def test_panels_are_of_one_size_and_their_labels_in_line(inputs):
    with figure_style():
        drawn = drawings("fit", inputs)[0]
        figure = compose(drawn)
        assert 0.3 < figure.get_figheight() - drawn.grid.height < 0.5, "room for the legend"
        (legend,) = figure.legends
        assert legend.get_window_extent().width <= figure.bbox.width
        assert not legend.get_frame_on()
        title, axes = figure.axes[0].title.get_window_extent(), figure.axes[0].get_window_extent()
        assert 0 <= title.y0 - axes.y1 < 10, "the title stands on the axes"
        panels = [ax.get_window_extent() for ax in figure.axes]
        assert np.ptp([panel.width for panel in panels]) < 1e-6
        assert panels[0].height == pytest.approx(2 * panels[1].height)
        boxes(figure)
        labels = [
            ax.yaxis.label.get_window_extent(RendererBase()).x0
            for ax in figure.axes
            if ax.get_ylabel()
        ]
        assert len(labels) >= 2
        assert np.ptp(labels) < 0.1


def courses_of(inputs, **fusion):
    """The figure of the model over the levels, drawn by a model that is joined otherwise."""
    body = inputs.model.body
    model = of_pieces(inputs.model, fusion=replace(body.fusion, **fusion))
    (drawing,) = level_figures(replace(inputs, model=model), model.body)
    return model, drawing


def test_places_of_courses_are_in_the_unit_of_their_input(inputs):
    free = min(curve.limits["strain"][1] for curve in inputs.model.body.curves)
    places = [share * free for share in (0.1, 0.5, 0.9)]
    for unit, ending in (("1", "; dots"), ("mm", " mm; dots")):
        quantities = inputs.dataset.quantities
        along = replace(quantities["strain"], unit=unit)
        study = replace(
            inputs, whole=replace(inputs.whole, quantities={**quantities, "strain": along})
        )
        (drawing,) = level_figures(study, study.model.body)
        at = ", ".join(f"{place:.3g}" for place in places)
        assert f" over pressure at strain {at}{ending} mark the training levels." in drawing.caption
        columns = [name for name in drawing.panels[0].data if " at strain " in name]
        assert columns == [f"{inputs.own} at strain {place:.6g} [N]" for place in places]


def test_there_are_courses_between_two_levels_at_least(inputs):
    body = inputs.model.body
    for count, figures in ((1, 0), (2, 1)):
        some = replace(body, curves=body.curves[:count])
        study = replace(inputs, model=replace(inputs.model, body=some))
        assert len(level_figures(study, some)) == figures
    pchip = replace(body, fusion=replace(body.fusion, levels="pchip"))
    assert level_figures(inputs, pchip) == []


def test_a_residual_that_is_shrunk_between_levels_is_told(inputs):
    for shrink, words in ((1.0, ""), (0.25, "Midway between levels, 25% of what the pieces add")):
        _, drawing = courses_of(inputs, shrink=shrink)
        assert ("Midway" in drawing.caption) == bool(words)
        assert words in drawing.caption


def test_of_many_levels_some_are_marked_and_the_caption_says_how_many(inputs, monkeypatch):
    monkeypatch.setattr("mapmore_cli.reporting.figures.panels.DOTS", 2)
    _, drawing = courses_of(inputs)
    assert " 2 of 3 training levels are drawn" in drawing.caption
    figure = compose(drawing)
    assert 0 < figure.get_figheight() - drawing.grid.height < 0.3, "without a legend"
    marked = figure.axes[0].lines[1].get_xdata()
    assert marked.tolist() == [80, 350]


def test_a_number_beyond_the_levels_is_not_drawn(inputs):
    for below, first in (("saturate", 58.4), (100.0, 80.0)):
        sides = {"pressure": (below, "saturate"), "strain": ("continue", "continue")}
        _, drawing = courses_of(inputs, extrapolation=sides)
        assert min(drawing.panels[0].data["pressure [kPa]"]) == pytest.approx(first)


class TestManyInputs:
    def test_the_target_and_the_first_quantities_have_a_panel(self, inputs, monkeypatch):
        assert "every quantity" in drawing(inputs, "data").caption
        count = len({*inputs.dataset.recordings[0].columns} - {"time", inputs.dataset.target})
        monkeypatch.setattr(data, "MOST_QUANTITIES", 2)
        few = drawing(inputs, "data")
        assert f"the target and 1 of {count} other quantities" in few.caption
        for panel in few.panels:
            assert sum(label != "" for label in panel.y_labels) == 2
            assert any(label.startswith("Force") for label in panel.y_labels)

    def test_the_input_that_most_is_left_of_has_a_residual_panel(self, inputs, monkeypatch):
        own, *_ = inputs.validation.residual_tests
        first, second = (quantity.name for quantity in inputs.model.inputs)
        tests = [
            replace(own, name=name, x=0 * values, values=values, bounds=np.full(len(values), 0.5))
            for name, values in ((first, np.arange(30) % 2.0), (second, np.ones(4)))
        ]
        validation = replace(inputs.validation, residual_tests=(own, *tests))
        monkeypatch.setattr(residuals, "MOST_INPUTS", 1)
        few = drawing(replace(inputs, validation=validation), "residuals")
        assert [panel.key for panel in few.panels] == [own.name, second]
        assert "The 1 worst inputs are drawn." in few.caption
