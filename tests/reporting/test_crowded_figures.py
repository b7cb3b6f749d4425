"""Figures of many models, of models that are far off, of repeated measurements; the places of
panels.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backend_bases import RendererBase
from report_builder import build, legend_of, of_pieces, surface

from mapmore_cli.domain.scores import REPEATABILITY
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.signals.sampling import MANY
from mapmore_cli.reporting.figures import data, residuals
from mapmore_cli.reporting.figures.drawing import POINTS, compose, drawings
from mapmore_cli.reporting.figures.segments import level_figures
from mapmore_cli.reporting.figures.style import figure_style, model_styles
from mapmore_cli.reporting.inputs import MOST_LINES
from mapmore_cli.reporting.order import FIGURES
from mapmore_cli.reporting.score_tables import score_table
from mapmore_cli.reporting.sections import all_tables

NEAR = {
    f"near_{shift}": lambda p, e, shift=shift: surface(p, e) + shift for shift in range(9, 0, -1)
}
FAR = {"far": lambda p, e: surface(p, e) + 4000 * e**0.5}


def drawing(inputs, name):
    with figure_style():
        return next(
            found for found in drawings(name.partition("_")[0], inputs) if found.name == name
        )


@pytest.fixture(scope="module")
def crowd():
    return build(competitors=NEAR)


@pytest.fixture(scope="module")
def outlier():
    return build(competitors={"near": lambda p, e: surface(p, e) + 9, **FAR})


@pytest.fixture(scope="module")
def repeated(inputs):
    floors = [
        replace(s, model=REPEATABILITY, rmse=3.0, nrmse=0.01)
        for s in inputs.validation.scores
        if s.model == "sarosi"
    ]
    return replace(
        inputs, validation=replace(inputs.validation, scores=(*inputs.validation.scores, *floors))
    )


class TestManyModels:
    def test_lines_are_drawn_of_the_best_in_the_order_of_the_table(self, crowd):
        assert crowd.lines == ("mapmore", *(f"near_{shift}" for shift in (6, 5, 4, 3, 2, 1)))
        fit = drawing(crowd, "fit")
        assert legend_of(compose(fit)) == ["measured", *crowd.lines]
        assert "Of 10 models" in fit.caption

    def test_every_line_has_a_look_of_its_own(self, crowd):
        styles = model_styles([*crowd.lines, *crowd.models])
        assert len({styles[model] for model in crowd.lines}) == MOST_LINES

    def test_few_models_are_all_drawn(self, inputs):
        assert inputs.lines == inputs.models
        assert "models" not in drawing(inputs, "fit").caption


class TestFarOff:
    def test_they_do_not_set_the_scale(self, outlier):
        assert outlier.far_off == ("far",)
        near = build(competitors={"near": lambda p, e: surface(p, e) + 9})
        for name in ("fit", "error"):
            held, free = (drawing(study, name) for study in (outlier, near))
            for ax, same in zip(compose(held).axes, compose(free).axes, strict=False):
                assert np.ptp(ax.get_ylim()) == pytest.approx(np.ptp(same.get_ylim()), rel=0.15)
            assert held.caption.endswith("Too far off for the scale: far.")
            assert "Too far" not in free.caption

    def test_their_panel_says_how_far(self, outlier):
        errors = np.abs(np.concatenate(outlier.validation.predictions["far"]) - np.concatenate(
            [curve.columns["force"] for curve in outlier.dataset.curves]
        ))  # fmt: skip
        with figure_style():
            panels = {
                ax.get_title(loc="left"): ax for ax in compose(drawing(outlier, "error")).axes
            }
        assert [text.get_text() for text in panels["far"].texts] == [
            f"beyond the scale: up to {errors.max():.3g} N"
        ]
        assert not panels["mapmore"].texts

    def test_an_own_model_that_is_worst_hides_nobody(self, outlier):
        predictions = outlier.validation.predictions
        swapped = replace(
            outlier.validation,
            predictions={"far": predictions["far"], "mapmore": predictions["mapmore"]},
        )
        assert replace(outlier, validation=swapped).far_off == ()


class TestRepeatability:
    def test_a_dashed_line_marks_it_among_the_bars(self, inputs, repeated):
        plain, marked = drawing(inputs, "nrmse"), drawing(repeated, "nrmse")
        assert len(compose(marked).axes[0].patches) == len(compose(plain).axes[0].patches)
        lines = compose(marked).axes[0].lines[: 1 + len(compose(plain).axes[0].lines)]
        assert [
            line.get_xdata()[0]
            for line in lines
            if len(set(line.get_xdata())) == 1 and len(line.get_xdata()) == 2
        ] == [1.0]
        assert "repeated measurements" in marked.caption
        assert "repeated measurements" not in plain.caption

    def test_it_is_no_model_of_any_figure(self, repeated):
        assert REPEATABILITY not in repeated.models
        assert REPEATABILITY not in repeated.lines
        titles = [ax.get_title(loc="left") for ax in compose(drawing(repeated, "error")).axes]
        assert REPEATABILITY not in titles

    def test_the_table_says_what_it_is(self, inputs, repeated):
        units = repeated.validation.units
        table, plain = (
            score_table(repeated.validation.scores, units),
            score_table(inputs.validation.scores, units),
        )
        assert len(table.rows) == len(plain.rows) + 2
        assert any(note.startswith(REPEATABILITY) for note in table.notes)
        assert not any(note.startswith(REPEATABILITY) for note in plain.notes)


# of models with memory
NAMES = [name for name in FIGURES if name not in ("loops", "motion", "convergence")]


def boxes(figure):
    """What every panel covers with its labels, in points."""
    return [ax.get_tightbbox(RendererBase(), for_layout_only=True).extents for ax in figure.axes]


def panels_of(figure):
    return sum(ax.get_label() != "<colorbar>" for ax in figure.axes)


@pytest.mark.parametrize("name", NAMES)
def test_labels_keep_to_their_panels_and_every_panel_can_stand_alone(name, mixed):
    """No label leaves the page or lies on another panel."""
    with figure_style():
        for drawing in drawings(name, mixed):
            figure = compose(drawing)
            width, height = figure.get_size_inches() * POINTS
            legends = (legend.get_window_extent(RendererBase()) for legend in figure.legends)
            top = min((legend.y0 for legend in legends), default=height)
            found = boxes(figure)
            for left, low, right, high in found:
                assert -0.1 <= left < right <= width + 0.1
                assert -0.1 <= low < high <= top + 0.1
            for one, other in combinations(found, 2):
                beside = one[2] <= other[0] or other[2] <= one[0]
                assert beside or one[3] <= other[1] or other[3] <= one[1]
            stacks = [panels_of(compose(drawing, mixed.style, panel)) for panel in drawing.panels]
            assert panels_of(figure) == sum(stacks)
            assert {*stacks} == {len(drawing.grid.stack)}
            assert len({panel.key for panel in drawing.panels}) == len(drawing.panels)
            for panel in drawing.panels:
                assert len({len(values) for values in panel.data.values()}) == 1


def test_panels_are_of_one_size_and_their_labels_in_line(inputs):
    with figure_style():
        figure = compose(drawings("fit", inputs)[0])
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


LEVELS = np.array([80.0, 150.0, 350.0])


def courses_of(inputs, **fusion):
    """The figure of the model over the levels, drawn by a model that is joined otherwise."""
    body = inputs.model.body
    model = of_pieces(inputs.model, fusion=replace(body.fusion, **fusion))
    (drawing,) = level_figures(replace(inputs, model=model), model.body)
    return model, drawing


def test_of_many_levels_some_are_marked_and_the_caption_says_how_many(inputs, monkeypatch):
    monkeypatch.setattr("mapmore_cli.reporting.figures.panels.DOTS", 2)
    _, drawing = courses_of(inputs)
    assert " 2 of 3 training levels are drawn" in drawing.caption
    marked = compose(drawing).axes[0].lines[1].get_xdata()
    assert marked.tolist() == [80, 350]


def test_long_curves_are_drawn_of_samples_with_the_extremes_among_them():
    """Scores, bands and counts are of all samples."""
    inputs = build(samples=30_000, levels=(80, 150, 250))
    shown, whole = inputs.validation.shown, inputs.whole
    kept = inputs.validation.predictions["mapmore"]
    for few, every, predicted in zip(shown.curves, whole.curves, kept, strict=True):
        assert 1000 < few.size <= MANY < every.size
        assert few.columns["force"].max() == every.columns["force"].max()
        error = predicted - few.columns["force"]
        of_all = predict(inputs.model, every.columns) - every.columns["force"]
        assert (error.min(), error.max()) == (of_all.min(), of_all.max())
    assert sum(band.samples for band in inputs.validation.bands) == 30_000
    assert {panel.key for panel in drawing(inputs, "fit").panels} == {"pressure=250"}
    assert len(drawing(inputs, "segments").panels[0].data["segment"]) < MANY
    tables = {table.name: table for table in all_tables(inputs)}
    assert [row[2] + row[3] for row in tables["levels"].rows] == [30_000] * 3


def test_a_number_beyond_the_levels_is_not_drawn(inputs):
    for below, first in (("saturate", 58.4), (100.0, 80.0)):
        sides = {"pressure": (below, "saturate"), "strain": ("continue", "continue")}
        _, drawing = courses_of(inputs, extrapolation=sides)
        assert min(drawing.panels[0].data["pressure [kPa]"]) == pytest.approx(first)


def test_courses_are_the_models_predictions_within_the_range_of_all_curves(inputs):
    model, drawing = courses_of(inputs)
    (panel,) = drawing.panels
    (_, x), *courses = panel.data.items()
    shortest = min(curve.limits["strain"][1] for curve in model.body.curves)
    lines = compose(drawing).axes[0].lines
    assert len(lines) == 2 * len(courses)
    for (heading, y), dots in zip(courses, lines[1::2], strict=True):
        place = float(heading.split()[3])
        assert 0 < place < shortest
        at = {"pressure": x, "strain": np.full(len(x), place)}
        np.testing.assert_allclose(y, predict(model, at), rtol=1e-4)
        np.testing.assert_array_equal(dots.get_data(), (LEVELS, y[np.isin(x, LEVELS)]))


def test_one_level_has_no_way_to_draw(alone):
    assert [drawing.name for drawing in drawings("segments", alone)] == ["segments"]


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
            replace(own, name=name, x=np.arange(4.0), values=values, bounds=np.full(4, 0.5))
            for name, values in ((first, np.zeros(4)), (second, np.ones(4)))
        ]
        validation = replace(inputs.validation, residual_tests=(own, *tests))
        monkeypatch.setattr(residuals, "MOST_INPUTS", 1)
        few = drawing(replace(inputs, validation=validation), "residuals")
        assert [panel.key for panel in few.panels] == [own.name, second]
        assert "The 1 worst inputs are drawn." in few.caption
