import re
from dataclasses import replace
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_builder import build, drawn, legend_of, of_pieces

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.scores import REPEATABILITY
from mapmore_cli.reporting.figures import elements, panels, style
from mapmore_cli.reporting.figures.drawing import drawings
from mapmore_cli.reporting.figures.fit import curve_fit, held_out_spans
from mapmore_cli.reporting.figures.segments import draw_segments, segment_curves
from mapmore_cli.reporting.figures.terms import left_unexplained, whole_curves
from mapmore_cli.reporting.inputs import FigureStyle


@pytest.fixture(scope="module")
def every(inputs):
    """All figures of a study."""
    return drawn(inputs)


def test_curves_and_logs_are_meant_by_their_id_their_level_or_their_label(inputs):
    for words in ("pressure=250", "250", "250 kPa"):
        assert inputs.ids_of(words) == {"pressure=250"}
    assert inputs.ids_of("load_cycle_250") == {"load_cycle_250"}
    assert inputs.ids_of("pressure") == frozenset()
    first, second, *others = inputs.dataset.recordings
    logs = (replace(first, log="whole"), replace(second, log="whole"), *others)
    cut = replace(inputs, whole=replace(inputs.whole, recordings=logs))
    assert cut.ids_of("whole") == {first.id, second.id}


def test_models_that_are_named_stay_beside_the_own_one_in_their_order(inputs):
    row = inputs.validation.scores[0]
    scores = (*inputs.validation.scores, replace(row, model=REPEATABILITY))
    study = replace(inputs, validation=replace(inputs.validation, scores=scores))
    few = study.beside(["polynomial_2"])
    assert few.models == ("mapmore", "polynomial_2")
    assert {row.model for row in few.validation.scores} == {*few.models, REPEATABILITY}
    assert study.beside(["polynomial_2", "sarosi"]).models[1:] == ("polynomial_2", "sarosi")
    with pytest.raises(UsageError, match="compares no model called 'cubic'"):
        study.beside(["sarosi", "cubic"])


class TestThinning:
    @given(st.lists(st.text(max_size=60), min_size=1, max_size=8), st.integers(8, 40))
    def test_titles_differ_where_names_do(self, names, length):
        shown = panels.told_apart(names, length)
        assert len({*shown}) == len({*names})
        assert all(len(title) <= length for title in shown)


class TestLabels:
    def test_units(self):
        assert FigureStyle().axis_label(Quantity("strain_rate", "1/s")) == "Strain rate (1/s)"
        assert FigureStyle().axis_label(Quantity("strain", "1")) == "Strain (–)"
        assert FigureStyle().axis_label(Quantity("force", "N"), "measured") == "Measured force (N)"
        own = FigureStyle(labels={"force": "$F$ (N)"})
        assert own.axis_label(Quantity("force", "N"), "measured") == "measured $F$ (N)"
        assert own.axis_label(Quantity("force", "N")) == "$F$ (N)"
        assert [own.is_own_label(text) for text in ("measured $F$ (N)", "Force (N)")] == [1, 0]

    def test_curves_are_named_by_their_level(self, inputs):
        curve = inputs.dataset.curves[0]
        assert inputs.curve_label(curve) == "80 kPa"
        assert inputs.curve_label(replace(curve, level=None)) == "pressure=80"
        strain = replace(inputs, whole=replace(inputs.dataset, level="strain"))
        assert strain.curve_label(replace(curve, level=0.0412088)) == "strain 0.04121"

    def test_every_label_names_its_unit_in_letters_of_seven_points_at_least(self, every):
        for name, figure in every.items():
            labels = [
                label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel()) if label
            ]
            assert labels, name
            assert all(label.endswith(")") and "(" in label for label in labels), (name, labels)
            figure.draw_without_rendering()
            texts = [text for text in figure.findobj(mpl.text.Text) if text.get_text()]
            assert min(text.get_fontsize() for text in texts) >= 7, name
            assert max(text.get_fontsize() for text in texts) < 12, name

    def test_lines_are_thin_marks_are_small_and_figures_are_lower_than_a_page(self, every):
        for name, figure in every.items():
            lines = figure.findobj(mpl.lines.Line2D)
            assert max(line.get_linewidth() for line in lines) <= 2, name
            marked = [line for line in lines if line.get_marker() in elements.SHAPES]
            most = 3 if name == "surface_3d" else 10
            assert max((line.get_markersize() for line in marked), default=0.0) < most, name
            assert figure.get_figheight() < 9, name
            for legend in figure.legends:
                assert legend.get_window_extent().width <= figure.bbox.width, name


def test_panels_of_errors_share_their_axes(every):
    first, *others = every["error"].axes
    for shared in (first.get_shared_x_axes(), first.get_shared_y_axes()):
        assert all(shared.joined(first, ax) for ax in others)
    labels = [bool(ax.get_ylabel()) for ax in every["error"].axes]
    assert labels == [True, False, False], "a label beside the first panel is for all"
    assert all(ax.get_ylabel() for ax in every["residuals"].axes)
    assert len({ax.get_xlim() for ax in every["residuals"].axes}) == 2  # lags, and an input


def test_the_own_model_always_looks_the_same_and_no_two_models_do():
    styles = style.model_styles(["mapmore", *"abcdef"])
    assert styles["mapmore"] == style.model_styles(["mapmore"])["mapmore"]
    for looks in ("colour", "dashes", "marker"):  # told apart without colour too
        assert len({str(getattr(look, looks)) for look in styles.values()}) == 7
    own, *others = styles.values()
    assert all(own.width > other.width >= 1 for other in others)
    assert own.width < 2
    assert others[0].colour == style.BLUE
    assert own.zorder < min(other.zorder for other in others), "seen below the dashed lines"
    assert all(max(other.dashes[1]) < 10 for other in others)


class TestFit:
    def test_samples_are_put_in_order(self, inputs):
        shuffle = np.random.default_rng(1).permutation(200)
        curves = tuple(curve.at(shuffle) for curve in inputs.dataset.curves)
        predictions = {
            name: tuple(y[shuffle] for y in of)
            for name, of in inputs.validation.predictions.items()
        }
        changed = replace(
            inputs,
            whole=replace(inputs.dataset, curves=curves),
            validation=replace(inputs.validation, predictions=predictions),
        )
        panel, same = curve_fit(inputs, 2), curve_fit(changed, 2)
        np.testing.assert_array_equal(panel.y, same.y)
        np.testing.assert_array_equal(panel.predictions["mapmore"], same.predictions["mapmore"])

    def test_held_out_regions_are_marked_in_mixed_curves_only(self, inputs, mixed):
        assert [len(ax.patches) for ax in drawn(inputs, "fit")["fit"].axes] == [0, 0]
        figure = drawn(mixed, "fit")["fit"]
        assert [len(ax.patches) for ax in figure.axes] == [1] * 8
        assert len({ax.get_xlim() for ax in figure.axes}) == 1
        panel, (span,) = curve_fit(mixed, 0), figure.axes[0].patches
        low, high = span.get_x(), span.get_x() + span.get_width()
        np.testing.assert_array_equal((panel.x > low) & (panel.x < high), panel.held_out)
        assert legend_of(figure)[:2] == ["held out", "training"]

    def test_spans_reach_halfway_to_the_neighbours(self):
        x = np.arange(5.0)
        held_out = np.array([True, False, False, True, True])
        assert held_out_spans(x, held_out) == [(0.0, 0.5), (2.5, 4.0)]
        assert held_out_spans(x, np.zeros(5, dtype=bool)) == []

    def test_without_held_out_samples_there_are_training_curves_only(self, alone):
        assert list(drawn(alone, "fit")) == ["fit_training"]


class TestSegments:
    def test_each_training_sample_belongs_to_its_segment(self, inputs, mixed):
        for study in (inputs, mixed):
            for panel, cut in zip(segment_curves(study, 0), study.segmentation, strict=True):
                assert (panel.cell >= 1).all()
                for segment in cut.segments:
                    assert np.sum(panel.cell == segment.cell[0]) == len(segment.rows)
                low, high = panel.boundaries[panel.cell - 1], panel.boundaries[panel.cell]
                assert ((panel.x >= low - 1e-12) & (panel.x <= high + 1e-12)).all()

    @pytest.mark.parametrize("z_s", [0.0, 0.25, 0.5])
    def test_one_line_a_segment_whose_weights_sum_to_one(self, inputs, z_s):
        """Boundaries and zones follow M2's equations 10 and 11."""
        fusion = replace(inputs.model.body.fusion, transition="cubic", z_s=z_s)
        top, bottom = mpl.figure.Figure().subplots(2)
        panel = replace(segment_curves(inputs, 0)[0], boundaries=np.array([0, 0.01, 0.03, 0.05]))
        draw_segments(top, bottom, panel, fusion)
        samples, weights = top.lines[:3], bottom.lines[:3]
        assert len({(line.get_color(), line.get_marker()) for line in samples}) == 3
        total = np.nansum([line.get_ydata() for line in weights], axis=0)
        np.testing.assert_allclose(total, 1, atol=1e-12)
        assert min(np.nanmin(line.get_ydata()) for line in weights) > 0, "no line along zero"
        assert bottom.get_ylim() == pytest.approx((0, 1), abs=0.1)
        assert [line.get_xdata()[0] for line in bottom.lines[3:]] == [0, 0.01, 0.03, 0.05]
        ends = [(zone.get_x(), zone.get_x() + zone.get_width()) for zone in top.patches]
        np.testing.assert_allclose(
            ends, [(0.01 - z_s * 0.01, 0.01 + z_s * 0.02), (0.03 - z_s * 0.02, 0.03 + z_s * 0.02)]
        )

    def test_a_formula_alone_has_no_segments_to_draw(self, inputs):
        assert drawn(replace(inputs, model=of_pieces(inputs.model, curves=())), "segments") == {}


class TestTerms:
    def test_left_over_shares_of_choice_and_runner_up(self, inputs):
        fit = inputs.fit.segments[0]
        err_all = np.array([[0.6, 0.7, 0.1], [0.2, np.nan, 0.1], [0.3, np.nan, 0.05]])
        steps = {"err": np.array([0.7, 0.2, 0.05]), "runner_up": np.array([0, 2, -1])}
        selection = replace(fit.selection, err_all=err_all, **steps)
        left, by_runner_up = left_unexplained(replace(fit, selection=selection))
        assert left == pytest.approx([30, 10, 5])
        assert by_runner_up == pytest.approx([40, 20, np.nan], nan_ok=True)

    def test_too_many_segments_are_those_of_whole_curves_evenly_spread(self):
        fits = [SimpleNamespace(curve=curve) for curve in "aabbccddee"]
        assert whole_curves(fits, 10) == fits
        assert "".join(fit.curve for fit in whole_curves(fits, 9)) == "aabbddee"
        assert "".join(fit.curve for fit in whole_curves(fits, 2)) == "aaee"

    def test_no_terms_no_figure(self, inputs):
        assert drawn(replace(inputs, fit=replace(inputs.fit, body=None)), "terms") == {}


def test_lines_of_words_go_down_and_turned_ones_end_at_their_place():
    def heights(**turned):
        made = elements.text("a\nb\nc", 3.0, 50.0, 10.0, **turned)
        return [float(y) for y in re.findall(r'tspan x="3.0" y="([^"]+)"', made)]

    assert heights() == [50.0, 61.5, 73.0]
    assert heights(turned=True) == [27.0, 38.5, 50.0]


def test_a_path_has_a_gap_where_a_number_is_missing():
    x, y = np.array([0.0, 1.0, np.nan, 3.0, 4.0, 5.0]), np.array([0.0, 1.0, 2.0, 3.0, np.inf, 5.0])
    assert elements.path(x, y) == "M0 0l1 1m2 2m2 2"
    assert elements.path(x[2:3], y[2:3]) == ""


def test_steps_of_a_path_end_at_the_places_of_its_points():
    """After a thousand steps too; a point that is drawn already adds nothing."""
    x, y = np.cumsum(np.random.default_rng(0).normal(0, 0.7, (2, 1000)), axis=1)
    steps = re.findall(r"([Ml])(-?[\d.]+) ?(-?[\d.]+)", elements.path(x, y))
    places = np.cumsum([[float(across), float(up)] for _, across, up in steps], axis=0)
    expected = np.round(np.column_stack([x, y]), 1)
    moved = (np.diff(expected, axis=0, prepend=np.nan) != 0).any(axis=1)
    assert 800 < len(places) < 1000
    np.testing.assert_allclose(places, expected[moved], atol=1e-9)


def test_a_dot_is_drawn_once_at_each_place():
    x, y = np.array([2.0, 1.0, np.nan, 1.01, 2.0]), np.array([5.0, 5.0, 5.0, 5.0, 4.84])
    look = {"markeredgewidth": 0.0}
    dots = elements.markers(x, y, "o", "#000000", look)
    assert '<path d="M1 5h0m1-.2h0m0 .2h0"' in dots
    assert 'd=""' in elements.markers(x[2:3], y[2:3], "o", "#000000", look)


def test_dashes_and_markers_have_the_lengths_of_their_line():
    x, y = np.array([1.0, np.nan]), np.array([2.0, 3.0])
    line = elements.line_svg(x, y, {"linestyle": "--", "linewidth": 2.0, "color": "#000000"})
    assert 'stroke-width="2" stroke-dasharray="7.4 3.2"' in line
    look = {"markersize": 4.0, "markeredgewidth": 0.5}
    assert elements.markers(x, y, "o", "#000000", look).count('cx="1.0" cy="2.0" r="2"') == 1
    squares = elements.markers(x, y, "s", "#000000", look)
    assert squares.count("<path") == 1
    assert 'd="M-1 0l4 0l0 4l-4 0l0-4"' in squares  # 2 to each side of (1, 2)
    assert 'stroke-width="0.5"' in squares
    crosses = elements.markers(x, y, "x", "#000000", {"markersize": 2.0, "markeredgewidth": 0.0})
    assert 'd="M0 1l2 2m-2 0l2-2"' in crosses
    assert 'stroke-width="0.6"' in crosses  # without a stroke there would be nothing


class TestResiduals:
    def test_static_errors_are_tested_along_the_curve_and_over_every_input_that_varies(self):
        inputs = build()
        (drawing,) = drawings("residuals", inputs)
        # one held-out level: pressure does not vary
        assert [panel.key for panel in drawing.panels] == ["autocorrelation", "strain"]
        assert "held-out samples" in drawing.caption
        errors = (
            inputs.validation.predictions["mapmore"][2] - inputs.dataset.curves[2].columns["force"]
        )
        centred = errors - errors.mean()
        values = drawing.panels[0].data["Autocorrelation (–)"]
        np.testing.assert_allclose(values[1], centred[:-1] @ centred[1:] / (centred @ centred))
        # one term a segment leaves its shape
        assert "errors along strain are alike" in drawing.caption

    def test_training_errors_where_nothing_is_held_out(self):
        (drawing,) = drawings(
            "residuals", build(held_out=lambda _level, strain: np.zeros(len(strain), dtype=bool))
        )
        assert [panel.key for panel in drawing.panels] == ["autocorrelation", "pressure", "strain"]
        assert "training samples" in drawing.caption
        assert len(drawing.panels[1].data["Pressure (kPa)"]) == 4

    def test_few_samples_are_not_tested(self):
        assert drawings("residuals", build(samples=12, segments=1)) == []
