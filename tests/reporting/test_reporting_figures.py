from __future__ import annotations

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.figure import Figure
from report_builder import build, drawn, legend_of, of_pieces

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.reporting.figures import style
from mapmore_cli.reporting.figures.data import draw_trace, traces
from mapmore_cli.reporting.figures.drawing import compose, drawings
from mapmore_cli.reporting.figures.error import draw_errors, model_errors
from mapmore_cli.reporting.figures.fit import (
    curve_fit,
    draw_error,
    draw_fit,
    draw_training_curves,
    held_out_spans,
    label_curves,
    mark_held_out,
    training_curve_fits,
)
from mapmore_cli.reporting.figures.nrmse import draw_nrmse, nrmse_bars
from mapmore_cli.reporting.figures.segments import (
    draw_segments,
    draw_weights,
    draw_zones,
    segment_curves,
)
from mapmore_cli.reporting.figures.terms import term_steps, whole_curves
from mapmore_cli.reporting.inputs import FigureStyle
from mapmore_cli.reporting.table import title_of


@pytest.fixture(scope="module")
def every(inputs):
    """All figures of a study."""
    return drawn(inputs)


class TestThinning:
    @settings(deadline=None)
    @given(
        arrays(float, st.integers(0, 400), elements=st.floats(-1e6, 1e6) | st.just(np.nan)),
        st.integers(2, 60),
    )
    def test_few_points_no_peak_lost(self, y, limit):
        rows = style.envelope(y, limit)
        assert len(rows) <= max(limit, 2)
        assert (np.diff(rows) > 0).all()
        assert ((rows >= 0) & (rows < len(y))).all()
        if np.isfinite(y).any():
            assert np.nanmin(y[rows]) == np.nanmin(y)
            assert np.nanmax(y[rows]) == np.nanmax(y)

    @settings(deadline=None)
    @given(st.integers(0, 10**6), st.integers(1, 800), st.integers(5, 100))
    def test_a_cloud_keeps_the_extremes(self, seed, n, limit):
        random = np.random.default_rng(seed)
        x, y = random.normal(size=n), random.normal(size=n)
        y[random.random(n) < 0.1] = np.nan
        rows = style.cloud(x, y, limit)
        assert len(rows) <= limit
        assert (np.diff(rows) > 0).all()
        assert np.isfinite(y[rows]).all()
        if np.isfinite(y).any():
            assert (y[rows].min(), y[rows].max()) == (np.nanmin(y), np.nanmax(y))

    def test_bands_are_means_and_ranges(self):
        x = np.sort(np.random.default_rng(3).uniform(0, 5, 20_000))
        y = np.tile([1.0, -1.0], 10_000)
        line = style.band(x, y)
        assert len(line.x) == style.STRETCHES
        assert np.abs(line.mean).max() < 0.5
        np.testing.assert_array_equal(
            (line.low, line.high), (np.full(style.STRETCHES, -1), np.full(style.STRETCHES, 1))
        )
        assert not line.drawn_whole

    def test_a_band_has_no_points_where_there_are_no_samples(self):
        x = np.concatenate([np.linspace(0, 1, 2000), np.linspace(2, 3, 2000)])
        line = style.band(x, np.where(x == x[5], np.nan, x))
        assert not ((line.x > 1.01) & (line.x < 1.99)).any()
        np.testing.assert_allclose(line.mean, line.x)
        assert (line.low <= line.mean).all()
        assert (line.mean <= line.high).all()

    def test_few_samples_are_drawn_as_they_are(self, ax):
        x = np.linspace(0, 1, style.MOST_ON_A_LINE)
        style.draw_band(ax, x, x**2, "black")
        np.testing.assert_array_equal(ax.lines[0].get_ydata(), x**2)
        assert len(ax.collections) == 0
        style.draw_band(ax, np.append(x, 1), np.append(x, 1), "black")
        assert len(ax.collections) == 1

    @given(st.integers(1, 500), st.integers(2, 20))
    def test_spread_has_both_ends(self, count, limit):
        numbers = style.spread(count, limit)
        assert len(numbers) == min(count, limit)
        assert (numbers[0], numbers[-1]) == (0, count - 1)

    @given(st.text(max_size=60), st.integers(5, 40))
    def test_shortened_names_keep_both_ends(self, text, length):
        short = style.shortened(text, length)
        assert len(short) <= length
        if len(text) > length:
            assert text.startswith(short.split("…")[0])
            assert text.endswith(short[-1])

    @given(st.text(st.characters(exclude_characters="\n"), max_size=60), st.integers(4, 40))
    def test_two_lines_at_most_and_none_too_long(self, text, length):
        lines = style.two_lines(text, length).split("\n")
        assert len(lines) <= 2
        assert all(len(line) <= length for line in lines)


class TestLabels:
    def test_units(self):
        assert FigureStyle().axis_label(Quantity("strain_rate", "1/s")) == "Strain rate (1/s)"
        assert FigureStyle().axis_label(Quantity("strain", "1")) == "Strain (–)"
        assert FigureStyle().axis_label(Quantity("force", "N"), "measured") == "Measured force (N)"

    def test_curves_are_named_by_their_level(self, inputs):
        curve = inputs.dataset.curves[0]
        assert inputs.curve_label(curve) == "80 kPa"
        assert inputs.curve_label(replace(curve, level=None)) == "pressure=80"
        strain = replace(inputs, dataset=replace(inputs.dataset, level="strain"))
        assert strain.curve_label(replace(curve, level=0.0412088)) == "strain 0.04121"

    def test_every_lowest_axis_and_every_first_one_names_its_unit(self, every):
        for name, figure in every.items():
            labels = [
                label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel()) if label
            ]
            assert labels, name
            assert all(label.endswith(")") and "(" in label for label in labels), (name, labels)

    def test_no_letter_below_seven_points(self, every):
        for name, figure in every.items():
            figure.draw_without_rendering()
            sizes = [
                text.get_fontsize() for text in figure.findobj(mpl.text.Text) if text.get_text()
            ]
            assert min(sizes) >= 7, name

    def test_widths_are_those_of_journal_columns(self, every):
        assert {round(figure.get_figwidth(), 2) for figure in every.values()} <= {3.5, 7.16}


class TestStyles:
    def test_the_own_model_always_looks_the_same_and_no_two_models_do(self):
        styles = style.model_styles(["mapmore", *"abcdef"])
        assert styles["mapmore"] == style.model_styles(["mapmore"])["mapmore"]
        assert len({look.colour for look in styles.values()}) == 7
        assert (
            len({str(look.dashes) for look in styles.values()}) == 7
        )  # told apart without colour too
        assert len({look.marker for look in styles.values()}) == 7


class TestFit:
    def test_lines_are_the_predictions_in_order_of_strain(self, ax, inputs):
        panel = curve_fit(inputs, 2)
        draw_fit(ax, panel, style.model_styles(inputs.models))
        dots, *lines = ax.lines
        curve = inputs.dataset.curves[2]
        assert [line.get_label() for line in lines] == ["mapmore", "sarosi", "polynomial_2"]
        for line in lines:
            np.testing.assert_array_equal(line.get_xdata(), curve.columns["strain"])
            np.testing.assert_array_equal(
                line.get_ydata(), inputs.validation.predictions[line.get_label()][2]
            )
        assert set(dots.get_ydata()) <= set(curve.columns["force"])
        assert dots.get_ydata().max() == curve.columns["force"].max()

    def test_samples_are_put_in_order(self, inputs):
        curve = inputs.dataset.curves[2]
        shuffle = np.random.default_rng(1).permutation(curve.size)
        mixed_up = replace(
            curve, columns={name: values[shuffle] for name, values in curve.columns.items()}
        )
        predictions = {
            name: tuple(y[shuffle] if i == 2 else y for i, y in enumerate(of))
            for name, of in inputs.validation.predictions.items()
        }
        dataset = replace(
            inputs.dataset, curves=(*inputs.dataset.curves[:2], mixed_up, inputs.dataset.curves[3])
        )
        changed = replace(
            inputs, dataset=dataset, validation=replace(inputs.validation, predictions=predictions)
        )
        panel, same = curve_fit(inputs, 2), curve_fit(changed, 2)
        np.testing.assert_array_equal(panel.y, same.y)
        np.testing.assert_array_equal(panel.predictions["mapmore"], same.predictions["mapmore"])

    def test_error_is_predicted_minus_measured(self, ax, inputs):
        panel = curve_fit(inputs, 2)
        draw_error(ax, panel, style.model_styles(inputs.models))
        line = next(line for line in ax.lines if line.get_label() == "sarosi")
        np.testing.assert_array_equal(line.get_ydata(), panel.predictions["sarosi"] - panel.y)

    def test_one_pair_of_panels_a_held_out_curve(self, inputs, mixed):
        assert len(drawn(inputs, "fit")["fit"].axes) == 2
        assert len(drawn(mixed, "fit")["fit"].axes) == 8

    def test_held_out_regions_are_marked_in_mixed_curves_only(self, ax, inputs, mixed):
        mark_held_out(ax, curve_fit(inputs, 2))
        assert len(ax.patches) == 0
        panel = curve_fit(mixed, 2)
        mark_held_out(ax, panel)
        (span,) = ax.patches
        low, high = span.get_x(), span.get_x() + span.get_width()
        inside = (panel.x > low) & (panel.x < high)
        np.testing.assert_array_equal(inside, panel.held_out)
        assert legend_of(drawn(mixed, "fit")["fit"])[:2] == ["held out", "training"]

    def test_spans_reach_halfway_to_the_neighbours(self):
        x = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
        assert held_out_spans(x, np.array([True, False, False, True, True])) == [
            (0.0, 0.5),
            (2.5, 4.0),
        ]
        assert held_out_spans(x, np.zeros(5, dtype=bool)) == []

    def test_scattered_samples_are_told_by_dots_alone(self, ax):
        scattered = build(held_out=lambda _level, strain: np.arange(len(strain)) % 3 == 0)
        panel = curve_fit(scattered, 0)
        mark_held_out(ax, panel)
        assert len(ax.patches) == 0
        draw_fit(ax, panel, style.model_styles(scattered.models))
        training, held_out = ax.lines[:2]
        assert training.get_markerfacecolor() == "none"
        assert set(held_out.get_ydata()) <= set(panel.y[panel.held_out])
        assert set(training.get_ydata()) <= set(panel.y[~panel.held_out])

    def test_a_failed_formula_draws_nothing_and_is_called_failed(self, ax, failed):
        draw_fit(ax, curve_fit(failed, 2), style.model_styles(failed.models))
        assert [line.get_label() for line in ax.lines[1:]] == ["mapmore", "flat"]
        assert "Sárosi (failed)" in legend_of(drawn(failed, "fit")["fit"])

    def test_without_held_out_samples_there_are_training_curves_only(self, alone):
        assert list(drawn(alone, "fit")) == ["fit_training"]


class TestTraining:
    def test_held_out_samples_are_left_out(self, ax, mixed):
        bottom = Figure().subplots()
        panels = training_curve_fits(mixed)
        draw_training_curves(ax, bottom, panels, "mapmore", style.OWN_STYLE.colour)
        assert len(ax.lines) == 8
        for panel, line, error in zip(panels, ax.lines[1::2], bottom.lines[1:], strict=True):
            assert not panel.held_out.any()
            np.testing.assert_array_equal(line.get_ydata(), panel.predictions["mapmore"])
            np.testing.assert_array_equal(error.get_ydata(), panel.predictions["mapmore"] - panel.y)

    def test_curves_are_named_where_they_lie_apart(self, ax, inputs):
        panels = training_curve_fits(inputs)
        draw_training_curves(ax, Figure().subplots(), panels, "mapmore", style.OWN_STYLE.colour)
        label_curves(ax, panels)
        assert [text.get_text() for text in ax.texts] == ["80 kPa", "150 kPa", "350 kPa"]
        assert all(
            text.xy == (panel.x[0], panel.y[0])
            for text, panel in zip(ax.texts, panels, strict=True)
        )

    def test_names_that_would_cover_each_other_are_left_out(self, ax, inputs):
        panels = training_curve_fits(inputs)
        twins = [panels[0], replace(panels[0], title="twin"), panels[2]]
        draw_training_curves(ax, Figure().subplots(), twins, "mapmore", style.OWN_STYLE.colour)
        label_curves(ax, twins)
        assert len(ax.texts) == 2


class TestErrors:
    def test_all_samples_pooled_over_the_measured_value(self, inputs):
        panel = model_errors(inputs)[1]
        curve = inputs.dataset.curves[2]
        expected = dict(
            zip(
                curve.columns["force"],
                inputs.validation.predictions["sarosi"][2] - curve.columns["force"],
                strict=True,
            )
        )
        measured, error = panel.held_out
        assert (np.diff(measured) >= 0).all()
        assert dict(zip(measured, error, strict=True)) == expected
        assert len(panel.train[0]) == 600

    def test_a_failed_model_says_so(self, ax, failed):
        panel = next(panel for panel in model_errors(failed) if panel.model == "sarosi")
        draw_errors(ax, panel, style.model_styles(failed.models)["sarosi"])
        assert [text.get_text() for text in ax.texts] == ["failed"]
        assert len(ax.lines) == 1  # the line at zero


class TestNrmse:
    def bars(self, ax, inputs, published=None):
        bars = nrmse_bars(inputs.models, inputs.validation.scores, published or {})
        draw_nrmse(ax, bars, style.model_styles(inputs.models))
        return bars

    def test_bars_are_the_pooled_scores_in_per_cent(self, ax, inputs):
        self.bars(ax, inputs)
        pooled = {
            (s.model, s.split): 100 * s.nrmse for s in inputs.validation.scores if s.curve == "all"
        }
        expected = [
            pooled[model, split] for model in inputs.models for split in ("validate", "train")
        ]
        assert [patch.get_width() for patch in ax.patches] == pytest.approx(expected)
        assert ax.get_xlim()[0] == 0
        assert [label.get_text() for label in ax.get_yticklabels()] == list(
            map(title_of, inputs.models)
        )

    def test_published_markers_only_where_given(self, ax, inputs):
        self.bars(ax, inputs, {"mapmore": 0.022, "somebody_else": 0.5})
        (markers,) = ax.lines
        assert markers.get_xdata() == pytest.approx([2.2])
        assert (
            ax.patches[0].get_y()
            < markers.get_ydata()[0]
            < ax.patches[0].get_y() + ax.patches[0].get_height()
        )
        assert ax.texts[0].get_text().endswith("(published 2.2)")

    def test_nothing_published_no_marker_no_legend_entry(self, mixed, inputs):
        figure = drawn(mixed, "nrmse")["nrmse"]
        assert len(figure.axes[0].lines) == 0
        assert legend_of(figure) == ["held out", "training"]
        assert legend_of(drawn(inputs, "nrmse")["nrmse"]) == ["held out", "training", "published"]

    def test_a_failed_model_has_its_row_but_no_bar(self, ax, failed):
        self.bars(ax, failed)
        assert len(ax.patches) == 4
        assert [text.get_text() for text in ax.texts[2:4]] == ["failed", "failed"]

    def test_no_scores_no_figure(self, alone):
        assert drawn(replace(alone, validation=replace(alone.validation, scores=())), "nrmse") == {}


class TestSegments:
    def test_each_training_sample_belongs_to_its_segment(self, inputs, mixed):
        for study in (inputs, mixed):
            for panel, cut in zip(segment_curves(study, 0), study.segmentation, strict=True):
                assert (panel.cell >= 1).all()
                for segment in cut.segments:
                    assert np.sum(panel.cell == segment.cell[0]) == len(segment.rows)
                low, high = panel.boundaries[panel.cell - 1], panel.boundaries[panel.cell]
                assert ((panel.x >= low - 1e-12) & (panel.x <= high + 1e-12)).all()

    def test_one_line_a_segment(self, ax, inputs):
        draw_segments(ax, segment_curves(inputs, 0)[0])
        assert len(ax.lines) == 4
        assert len({(line.get_color(), line.get_marker()) for line in ax.lines}) == 4

    @pytest.mark.parametrize("z_s", [0.0, 0.25, 0.5])
    def test_drawn_weights_sum_to_one(self, ax, inputs, z_s):
        panel = segment_curves(inputs, 0)[0]
        draw_weights(ax, panel, "cubic", z_s)
        total = np.nansum([line.get_ydata() for line in ax.lines], axis=0)
        np.testing.assert_allclose(total, 1, atol=1e-12)

    def test_zones_and_boundaries_follow_equations_10_and_11(self, ax):
        draw_zones(ax, np.array([0.0, 1.0, 3.0]), 0.25)
        (zone,) = ax.patches
        assert (zone.get_x(), zone.get_x() + zone.get_width()) == (0.75, 1.5)
        assert [line.get_xdata()[0] for line in ax.lines] == [0, 1, 3]

    def test_a_formula_alone_has_no_segments_to_draw(self, inputs):
        assert drawn(replace(inputs, model=of_pieces(inputs.model, curves=())), "segments") == {}


class TestTerms:
    def test_left_over_shares_of_choice_and_runner_up(self, inputs):
        for fit in inputs.fit.segments:
            steps, err = term_steps(fit), np.sort(fit.selection.err_all[0])
            assert steps.left == pytest.approx([100 * (1 - err[-1])])
            assert steps.left_by_runner_up == pytest.approx([100 * (1 - err[-2])])

    def test_of_many_segments_whole_curves_are_shown(self):
        many = build(levels=list(range(60, 460, 10)))
        chosen = whole_curves(many.fit.segments, 40)
        assert len(chosen) <= 40
        for name in {fit.curve for fit in chosen}:
            assert [fit.cell for fit in chosen if fit.curve == name] == [(1,), (2,), (3,), (4,)]

    def test_no_terms_no_figure(self, inputs):
        assert drawn(replace(inputs, fit=replace(inputs.fit, body=None)), "terms") == {}


class TestTraces:
    def test_every_quantity_over_time(self, ax, inputs):
        recording = inputs.dataset.recordings[0]
        shown = traces(recording, inputs.dataset.quantities, FigureStyle())
        assert [trace.y_label for trace in shown] == ["Pressure (kPa)", "Strain (–)", "Force (N)"]
        draw_trace(ax, shown[2])
        x, y = ax.lines[0].get_data()
        assert len(x) <= 1500
        at = dict(zip(recording.columns["time"], recording.columns["force"], strict=True))
        assert all(at[time] == force for time, force in zip(x, y, strict=True))
        assert (y.min(), y.max()) == (
            recording.columns["force"].min(),
            recording.columns["force"].max(),
        )

    def test_without_time_the_sample_number_is_the_axis(self, inputs):
        recording = inputs.dataset.recordings[0]
        columns = {name: values for name, values in recording.columns.items() if name != "time"}
        trace = traces(
            replace(recording, columns=columns), inputs.dataset.quantities, FigureStyle()
        )[0]
        assert trace.x_label == "Sample (–)"
        assert trace.x[-1] == recording.rows_kept - 1

    def test_recordings_beyond_the_most_are_counted_in_the_caption(self):
        (drawing,) = drawings("data", build(levels=list(range(60, 460, 10))))
        assert "5 of 40 recordings are drawn" in drawing.caption
        assert len(compose(drawing).axes) == 15

    def test_recordings_of_which_nothing_was_kept_are_not_drawn(self, inputs):
        first, *others = inputs.dataset.recordings
        empty = replace(first, columns={name: values[:0] for name, values in first.columns.items()})
        some = replace(inputs, dataset=replace(inputs.dataset, recordings=(empty, *others)))
        assert [ax.get_title(loc="left") for ax in drawn(some, "data")["data"].axes[:3]] == [
            r.id for r in others
        ]
        none = replace(inputs, dataset=replace(inputs.dataset, recordings=(empty,)))
        assert drawn(none, "data") == {}


class TestResiduals:
    def test_static_errors_are_tested_along_the_curve_and_over_every_input_that_varies(self):
        (drawing,) = drawings("residuals", build())
        assert [panel.key for panel in drawing.panels] == [
            "autocorrelation",
            "strain",
        ]  # one held-out level: pressure does not vary
        assert "held-out samples" in drawing.caption
        curve = build().dataset.curves[2]
        errors = build().validation.predictions["mapmore"][2] - curve.columns["force"]
        centred = errors - errors.mean()
        values = drawing.panels[0].data["Autocorrelation (–)"]
        np.testing.assert_allclose(values[1], centred[:-1] @ centred[1:] / (centred @ centred))
        assert (
            "errors along strain are alike" in drawing.caption
        )  # one term a segment leaves its shape

    def test_training_errors_where_nothing_is_held_out(self):
        (drawing,) = drawings(
            "residuals", build(held_out=lambda _level, strain: np.zeros(len(strain), dtype=bool))
        )
        assert [panel.key for panel in drawing.panels] == ["autocorrelation", "pressure", "strain"]
        assert "training samples" in drawing.caption
        assert len(drawing.panels[1].data["Pressure (kPa)"]) == 4

    def test_few_samples_are_not_tested(self):
        assert drawings("residuals", build(samples=12, segments=1)) == []
