"""What figures draw, call by call: which numbers, in which order, and in which colours."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of
from export_samples import FORMULAS, STATIC
from matplotlib import rcParams
from matplotlib.colors import to_rgb
from report_builder import Recorder

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import ErrorBand
from mapmore_cli.domain.scores import REPEATABILITY
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.reporting.figures import (
    bands,
    colours,
    commands,
    data,
    drawing,
    elements,
    error,
    fit,
    nrmse,
    residual_map,
    segments,
    sketch,
    sketched,
    style,
    surface,
    terms,
)
from mapmore_cli.reporting.inputs import FigureStyle


def calls_of(panel, axes=1):
    made = [Recorder() for _ in range(axes)]
    panel.draw(*made)
    return made if axes > 1 else made[0]


def test_errors_of_training_are_pale_below_those_of_held_out_samples(mixed):
    (figure,) = error.draw(mixed)
    (pale, look), (held, own) = calls_of(figure.panels[0]).named("plot")
    assert (look["color"], own["color"]) == (style.LIGHT, style.VERMILLION)
    measured, held_out = mixed.pooled("force"), mixed.pooled_held_out
    assert {*pale[0]} <= {*measured[~held_out]}
    assert {*held[0]} <= {*measured[held_out]}
    assert {*held[1]} <= {*mixed.errors_of("mapmore")[held_out]}


def test_models_that_are_far_off_do_not_set_the_scale_and_say_how_far_they_are(inputs):
    scores = [replace(s, rmse=1e6) if s.model == "sarosi" else s for s in inputs.validation.scores]
    validation = replace(inputs.validation, scores=tuple(scores))
    (figure,) = error.draw(replace(inputs, validation=validation))
    assert figure.caption.endswith("Too far off for the scale: Sárosi.")
    own, far = map(calls_of, figure.panels[:2])
    assert [len(ax.named("plot")) for ax in (own, far)] == [2, 0]
    assert [len(ax.named("add_artist")) for ax in (own, far)] == [0, 2]
    largest = np.abs(inputs.errors_of("sarosi")).max()
    ((args, _),) = [call for ax in (own, far) for call in ax.named("annotate")]
    words, place = [args[0]], args[1]
    assert all(0 <= share <= 1 for share in place), "within the axes"
    assert words == [f"beyond the scale: up to {largest:.3g} N"]
    (held, *_) = fit.draw(replace(inputs, validation=validation))
    assert "Too far off for the scale: Sárosi." in held.caption


def test_bars_of_a_model_stand_around_its_row_the_held_out_one_above_and_solid(inputs):
    (figure,) = nrmse.draw(inputs)
    ax = calls_of(figure.panels[0])
    bars = ax.named("barh")
    assert [args[0] for args, _ in bars] == pytest.approx([-0.18, 0.18, 0.82, 1.18, 1.82, 2.18])
    scores = {(s.model, s.split): s.nrmse for s in inputs.validation.scores if s.curve == "all"}
    expected = [100 * scores[m, split] for m in inputs.models for split in ("validate", "train")]
    assert [args[1] for args, _ in bars] == pytest.approx(expected)
    assert [look["hatch"] is None for _, look in bars] == [True, False] * 3
    assert [entry.look["hatch"] is None for entry in figure.legend[:2]] == [True, False]
    assert [args for args, _ in ax.named("plot")] == [
        (pytest.approx(error), pytest.approx(row - 0.18))
        for row, error in enumerate((2.2, 2.5, 7.0))
    ]
    assert max(look["markersize"] for _, look in ax.named("plot")) < 10, "lower than a bar"
    assert not any(look["clip_on"] for _, look in ax.named("plot")), "whole at an error of zero"
    assert all(args[2] < 0.36 and look["linewidth"] < 2 for args, look in bars)  # apart
    assert ax.named("set_xlim") == [((), {"left": 0})]
    assert not ax.named("axvline")
    words = [args[0].split(" (published ") for args, _ in ax.named("annotate")]
    assert [float(error) for error, *_ in words] == pytest.approx(expected, abs=0.005)
    assert [*map(len, words)] == [2, 1] * 3
    failed = [
        replace(s, nrmse=np.nan) if s.model == "sarosi" else s for s in inputs.validation.scores
    ]
    study = replace(inputs, validation=replace(inputs.validation, scores=tuple(failed)))
    ax = calls_of(nrmse.draw(study)[0].panels[0])
    assert len(ax.named("barh")) == 4
    assert sum(args[0].startswith("failed") for args, _ in ax.named("annotate")) == 2
    row = next(s for s in inputs.validation.scores if (s.curve, s.split) == ("all", "validate"))
    scores = (*inputs.validation.scores, replace(row, model=REPEATABILITY, nrmse=0.015))
    study = replace(inputs, validation=replace(inputs.validation, scores=scores))
    (figure,) = nrmse.draw(study)
    (line,) = calls_of(figure.panels[0]).named("axvline")
    assert line[0] == (pytest.approx(1.5),)
    assert line[1]["linewidth"] < 2
    assert figure.legend[-1].label == "repeatability 1.50"


@pytest.mark.parametrize(("largest", "logarithmic"), [(20.0, False), (20.1, True)])
def test_errors_that_differ_by_more_than_twenty_times_are_on_a_logarithmic_axis(
    inputs, largest, logarithmic
):
    sizes = [
        ErrorBand(low, low + 1, 9, dict.fromkeys(inputs.models, low)) for low in (1.0, largest, 0.0)
    ]
    (figure,) = bands.draw(
        replace(inputs, validation=replace(inputs.validation, bands=tuple(sizes)))
    )
    ax = sketch.Sketch(7.0)
    figure.panels[0].draw(ax)
    assert {f"from [{inputs.target.unit}]", f"{inputs.own} [{inputs.target.unit}]"} <= {
        *figure.panels[0].data
    }
    assert ax.yaxis.logarithmic is logarithmic
    assert logarithmic or ax.yaxis.ends == (0.0, pytest.approx(1.05 * largest))
    assert not logarithmic or [*ax.yaxis.labels()] == [1, 2, 5, 10, 20]
    assert ax.xaxis.ends == pytest.approx((0, 2), abs=0.5)
    for count in (1, 2):
        some = replace(inputs.validation, bands=tuple(sizes[:count]))
        assert len(bands.draw(replace(inputs, validation=some))) == count - 1
    words = [bands._short(value) for value in (999.4, 1000.0, 99_999.0, 1e5, 0.12345)]
    assert words == ["999", "1000", "99999", "1e+05", "0.123"]


def test_a_map_of_errors_has_rims_around_held_out_samples(mixed, monkeypatch):
    monkeypatch.setattr(residual_map, "colour_bar", lambda *_, **_look: None)
    (figure,) = residual_map.draw(mixed)
    data, (panel,) = figure.panels[0].data, figure.panels
    (small, plain), (large, rimmed) = calls_of(panel).named("scatter")
    held = data["held out"].astype(bool)
    assert (small[2], large[2], rimmed["edgecolors"], plain["edgecolors"]) == (8, 16, "0.3", "none")
    errors = next(values for name, values in data.items() if name.startswith("Predicted less"))
    np.testing.assert_array_equal(large[3], errors[held])
    np.testing.assert_array_equal(small[3], errors[~held])
    limit = np.quantile(np.abs(errors), 0.98)
    assert (rimmed["vmin"], rimmed["vmax"]) == pytest.approx((-limit, limit))


def test_dots_have_the_colours_of_the_surface_at_their_values(inputs, monkeypatch):
    monkeypatch.setattr(surface, "colour_bar", lambda *_: None)
    (figure,) = surface.draw(inputs)
    ax = calls_of(figure.panels[0])
    ((_, areas),), ((_, dots),) = ax.named("contourf"), ax.named("scatter")
    assert (dots["vmin"], dots["vmax"]) == (areas["levels"][0], areas["levels"][-1])
    assert dots["cmap"] == areas["cmap"]


def test_figures_of_segments_are_named_by_their_variable(inputs):
    names = [figure.name for figure in segments.draw(inputs)]
    assert names == ["segments", "segments_levels"]
    fusion = inputs.model.body.fusion
    both = [replace(curve, boundaries=2 * curve.boundaries, variables=("strain", "strain"))
            for curve in inputs.segmentation]  # fmt: skip
    study = replace(inputs, segmentation=tuple(both))
    assert segments._variable_figure(study, fusion, 1, "strain").name == "segments_strain"


def test_shares_left_unexplained_are_between_powers_of_ten(inputs):
    (figure,) = terms.draw(inputs)
    ax = drawing.compose(figure).axes[0]
    ends = np.log10(ax.get_xlim())
    assert ends == pytest.approx(ends.round(), abs=1e-9)
    shown = np.concatenate([line.get_xdata() for line in ax.lines])
    shown = shown[np.isfinite(shown)]
    assert ends[0] <= np.log10(shown.min()) < ends[0] + 1.1
    assert {*figure.panels[0].data["step"]} == {1}  # every segment has one term
    assert ends[1] >= np.log10(shown.max()) > ends[1] - 1


def test_a_training_curve_has_its_error_below(inputs):
    (figure,) = fit.training_figures(inputs)
    top, bottom = calls_of(figure.panels[0], 2)
    curve, predicted = inputs.dataset.curves[0], inputs.validation.predictions["mapmore"][0]
    (x, y), _ = bottom.named("plot")[0]
    np.testing.assert_array_equal(x, curve.columns["strain"])
    np.testing.assert_allclose(y, predicted - curve.columns["force"])
    (_, line), look = top.named("plot")[0]
    np.testing.assert_array_equal(line, predicted)
    assert look["label"] == "mapmore"


def test_figures_of_curves_that_are_held_out_in_part_show_which_samples(mixed):
    """Although one curve is held out as a whole."""
    curves = list(mixed.dataset.curves)
    curves[2] = replace(curves[2], held_out=np.ones(curves[2].size, dtype=bool))
    dataset = replace(mixed.dataset, curves=tuple(curves))
    study = replace(mixed, whole=dataset)
    figure, training = fit.draw(study)
    assert figure.panels[0].draw.keywords == {"words": ("held out", "training")}
    assert "Filled dots and grey bands mark held-out samples" in figure.caption
    (panel,) = training.panels
    assert {*panel.data["data"]} == {"train"}
    assert len(panel.data["data"]) == sum(curve.training.sum() for curve in curves)
    own = [name for name in panel.data if name.endswith("[N]")]
    assert own == ["force [N]", "mapmore [N]"]
    for name, words in (("fit", "held-out curves"), ("training", "training curves")):
        (drawn,) = fit.curve_figures(study, name, [0])
        assert f"force of the {words}, predicted minus measured below" in drawn.caption


def test_recordings_over_time_stand_below_each_other_in_the_whole_width(mixed):
    curves = [
        replace(curve, columns=curve.columns | {"time": np.arange(curve.size) * 0.1})
        for curve in mixed.dataset.curves
    ]
    whole = replace(mixed.dataset, curves=tuple(curves))
    (figure,) = fit.curve_figures(replace(mixed, whole=whole, as_recorded=True), "fit", [0, 1])
    plan = drawing.arranged(figure, style.PLAIN)
    assert (plan.columns, plan.width) == (1, drawing.DOUBLE)
    assert figure.panels[0].x_label == "Time (s)"
    assert "grey where samples are used for training" in figure.caption


def test_a_model_without_pieces_is_named_in_the_caption(inputs):
    assert fit.own_words(inputs) == ""
    formula = replace(inputs, model=FORMULAS["sarosi"])
    assert fit.own_words(formula) == " mapmore is sarosi, fitted to the training samples here."
    other = replace(formula.validation, predictions={"sarosi": ()})
    assert fit.own_words(replace(formula, validation=other)) == ""


def test_a_loop_is_cut_where_samples_are_not_held_out():
    held = np.array([1, 1, 0, 1, 1, 1], dtype=bool)
    curve = curve_of({"u": np.arange(6.0), "y": np.arange(6.0) ** 2}, held)
    inputs = SimpleNamespace(
        dataset=SimpleNamespace(curves=[curve], target="y"),
        in_curve=Quantity("u", "1"),
        target=Quantity("y", "mm"),
        validation=SimpleNamespace(predictions={"mapmore": [-curve.columns["y"]]}),
        axis_label=lambda quantity: quantity.name,
        curve_label=lambda curve: curve.id,
    )
    (panel,) = fit._loops(inputs, 0, style.model_styles(["mapmore"]))
    drawn = [(*map(list, args), look["label"]) for args, look in calls_of(panel).named("plot")]
    assert drawn == [
        ([0, 1], [0, 1], "measured"),
        ([0, 1], [0, -1], "mapmore"),
        ([3, 4, 5], [9, 16, 25], "measured"),
        ([3, 4, 5], [-9, -16, -25], "mapmore"),
    ]
    assert panel.data["y [mm]"].tolist() == [0, 1, 9, 16, 25]


def test_a_model_is_drawn_for_each_training_curve_and_each_held_out_curve(monkeypatch):
    model, ax = STATIC["two variables"], Recorder()
    speed = np.array([0.2, 0.1, 0.3])
    columns = {"speed": speed, "force": 1e3 * speed, "strain": speed, "pressure": 200 + speed}
    held_out = [replace(curve_of(columns), id=name) for name in ("a", "b")]
    commands.draw_model(ax, model, None, held_out)
    lines = ax.named("plot")
    models = [(args, look) for args, look in lines if "label" in look]
    count = len(model.body.curves)
    assert [look["color"] for _, look in models] == style.level_colours(count + 2)
    assert [args[2] for args, _ in models] == ["-"] * count + ["--"] * 2
    for (x, y, _), curve in zip((args for args, _ in models), model.body.curves, strict=False):
        assert (x[0], x[-1]) == curve.limits["speed"]
        strain = np.full(len(x), np.mean(curve.limits["strain"]))
        at = {"speed": x, "strain": strain, "pressure": np.full(len(x), curve.level)}
        np.testing.assert_array_equal(y, predict(model, at))
    assert [look["label"] for _, look in models[-2:]] == ["a, held out", "b, held out"]
    assert [[*map(list, args)] for args, look in lines if "label" not in look] == [
        [[0.1, 0.2, 0.3], [100, 200, 300]]
    ] * 2
    assert not ax.named("fill_between")
    monkeypatch.setattr(commands, "half_widths_of", lambda *_: 2.0)
    commands.draw_model(ax, model, 0.95, [])
    for (_, low, high), ((_, y, _), _) in zip(
        (args for args, _ in ax.named("fill_between")), models, strict=False
    ):
        np.testing.assert_allclose([low, high], [y - 2, y + 2])


def test_a_recording_has_an_axis_for_each_quantity_of_any_recording(inputs):
    one, *_ = inputs.dataset.recordings
    series = {"time": 0.1 * np.arange(4), "force": np.arange(4.0), "strain": np.ones(4)}
    sets = (("force", "time", "strain"), ("force",), ("time",))
    recordings = tuple(
        replace(one, id=str(place), columns={name: series[name] for name in names})
        for place, names in enumerate(sets)
    )
    whole = replace(inputs.whole, recordings=recordings)
    (figure,) = data.draw(replace(inputs, whole=whole))
    assert [(panel.x_label, panel.y_labels) for panel in figure.panels] == [
        ("Time (s)", ("Force\n(N)", "Strain\n(–)")),
        ("Sample (–)", ("Force\n(N)", "")),
        ("Time (s)", ("", "")),
    ]
    assert figure.grid.stack == (1.0, 1.0)
    assert figure.grid.height == pytest.approx(0.3 + 2 * 0.95)
    most = data.MOST_QUANTITIES
    assert data._which(most) == "every quantity"
    assert data._which(most + 1) == f"the target and {most - 1} of {most} other quantities"


def test_a_drift_is_in_per_cent_of_the_first_campaign():
    points = [
        SimpleNamespace(inputs={"p": 100.0, "x": 0.12345}, outputs=(50.0, 55.0)),
        SimpleNamespace(inputs={"p": 200.0}, outputs=(-10.0, -8.0)),
    ]
    figure = commands.drift_drawing(["spring", "autumn"], points, Quantity("force", "N"))
    ax = calls_of(figure.panels[0])
    lines = [(args[0], look["label"]) for args, look in ax.named("plot")]
    assert 1 < figure.grid.height < 4
    assert lines == [
        (pytest.approx([100, 110]), "p 100, x 0.123"),
        (pytest.approx([100, 80]), "p 200"),
    ]
    assert ax.named("set_xticks")[0][0] == (range(2), ["spring", "autumn"])


# Colours and elements
# --------------------------------------------------------------------------------------------------


def test_levels_are_blue_from_pale_to_dark_and_a_palette_is_used_again():
    shades = [sum(to_rgb(colour)) for colour in style.level_colours(4)]
    assert shades == sorted(shades, reverse=True)
    assert style.level_colours(1) == ["#08306b"]
    looks = style.model_styles(["own", "a", "b", "own"], ["red", "blue"])
    assert [(name, look.colour) for name, look in looks.items()] == [
        ("own", "red"),
        ("a", "blue"),
        ("b", "red"),
    ]
    nested = "$" + "{" * 10 + "x" + "}" * 10 + "$"
    assert style.wrong_formula(nested) is None
    assert "nested 11 levels deep" in style.wrong_formula(nested.replace("x", "{x}"))
    assert "Expected" in style.wrong_formula(r"$\frac{1}$")


def test_colours_of_a_map_lie_between_its_neighbours():
    assert colours.colour_at("Blues", 0.0) == "#f7fbff"
    assert colours.colour_at("Blues", 1.0) == "#08306b"
    assert colours.colour_at("Blues", 0.25 / 8) == "#f1f7fd"  # a quarter from f7fbff to deebf7
    assert (colours.hex_of("0.8"), colours.hex_of("#123")) == ("#cccccc", "#123")
    shades = colours.Shades("Blues", np.array([0.0, 1.0, 2.0, 3.0]))
    ends = colours.colour_at("Blues", 0.0), colours.colour_at("Blues", 1.0)
    found = shades.of(np.array([-5.0, 0.5, 1.0, np.nan, 2.0, 9.0]))
    assert found == [ends[0], ends[0], colours.colour_at("Blues", 0.5), "", ends[1], ends[1]]


def svg_of(*calls):
    """What the last of the calls draws on a sheet whose places are ten times the numbers."""
    ax = sketch.Sketch(10.0)
    for name, args, look in calls:
        getattr(ax, name)(*args, **look)
    _, made = (ax.beside or ax.marks)[-1]
    return ax, made(*[lambda values: 10 * np.asarray(values, dtype=float)] * 2)


def test_a_sketch_draws_bars_areas_and_dots_at_their_places():
    look = {"facecolor": "#111", "edgecolor": "#222", "hatch": None}
    ax, bar = svg_of(("barh", (3.0, 5.0, 1.0), look))
    assert '<rect x="0.00" y="25.00" width="50.00" height="10.00"' in bar
    assert (ax.yaxis.low, ax.yaxis.high, ax.xaxis.low, ax.xaxis.high) == (2.5, 3.5, 0, 5)
    hatched = elements.face({"facecolor": "white", "edgecolor": "#222", "hatch": "//"})
    assert ("opacity" in bar, "#111" in bar) == (False, True)
    assert hatched.startswith('fill="#222" fill-opacity=".')  # pale
    ends = np.array([0.0, 1, 2, 3]), np.array([1.0, np.nan, 1, 1]), 2.0
    _, area = svg_of(("fill_between", ends, {"color": "#333", "alpha": 0.5}))
    assert 'd="M0 10l0 10ZM20 10l10 0l0 10l-10 0Z" fill="#333" fill-opacity="0.5"' in area
    _, dots = svg_of(
        ("scatter", (np.array([1.0]), np.array([2.0]), 16.0, np.array([0.0])),
         {"cmap": "Blues", "vmin": 0.0, "vmax": 1.0, "edgecolors": "0.2", "linewidths": 0.3}),
    )  # fmt: skip
    assert '<circle cx="10.0" cy="20.0" r="2" fill="#f7fbff"/>' in dots
    assert 'stroke="#333333" stroke-width="0.3"' in dots
    line = ([0.0, 1.0], [0.0, 2.0], "--")
    assert 'd="M0 0l10 20" ' in svg_of(("plot", line, {}))[1]
    assert "stroke-dasharray" in svg_of(("plot", line, {}))[1]
    limits = ("set_xlim", (2.0, 6.0), {}), ("set_ylim", (1.0, 4.0), {})
    for name, args, line in (
        ("axhline", (3.0,), "M20 30l40 0"),
        ("axvline", (3.0,), "M30 10l0 30"),
        ("vlines", ([3.0], 1.0, [2.0]), "M30 10l0 10"),
    ):
        assert f'd="{line}"' in svg_of((name, args, {}), *limits)[1]
    ranges = ("set_ylim", (1.0, 4.0), {}), ("axvspan", (2.0, 3.0), {"color": "#444"})
    assert '<rect x="20.00" y="10.00" width="10.00" height="30.00"' in svg_of(*ranges)[1]


def test_areas_lie_below_lines_and_lines_below_coloured_dots():
    ax, x = sketch.Sketch(7.0), np.arange(2.0)
    rims = {"edgecolors": "none", "linewidths": 0.0}
    ax.scatter(x, x, 9.0, x, cmap="Blues", vmin=0.0, vmax=1.0, **rims)
    ax.axhline(0.5)
    ax.plot(x, x)
    ax.fill_between(x, x, x + 1, color="#000", alpha=0.5)
    ax.axvspan(0.0, 1.0, color="#000")
    ax.barh(0.0, 1.0, 0.5)
    ax.contourf(*np.meshgrid(x, x), np.eye(2), levels=x, cmap="Blues")
    orders = [order for order, _ in ax.marks]
    dots, lines, areas = orders[:1], orders[1:3], orders[3:]
    assert max(areas) < min(lines) <= max(lines) < min(dots)


def test_a_sketch_writes_words_beside_their_places():
    """An offset upwards, an anchor, and space at the right for words that begin there."""
    limits = ("set_xlim", (2.0, 6.0), {}), ("set_ylim", (1.0, 4.0), {})
    ax, words = svg_of(*limits, ("annotate", ("ab", (3.0, 2.0), (5, 4)), {}))
    assert 'x="35.0" y="16.0">ab' in words
    assert ax.right == 0
    shares = {"xycoords": ("axes fraction", "data"), "va": "center", "ha": "right"}
    ax, words = svg_of(*limits, ("annotate", ("abc", (1.0, 2.0), (5, 0)), shares))
    assert 'text-anchor="end"' in words
    assert 'x="65.0" y="23.5">abc' in words  # 60 + 5, and 20 + 0.35 of the size
    assert ax.right == pytest.approx(5 + 3 * 0.55 * 10)
    half = {"xycoords": ("axes fraction", "axes fraction"), "va": "top"}
    assert (
        'x="40.0" y="33.0">a' in svg_of(*limits, ("annotate", ("a", (0.5, 0.5), (0, 0)), half))[1]
    )


def test_a_colour_bar_has_its_colours_from_bottom_to_top_and_its_ticks_beside():
    shades = colours.Shades("Blues", np.array([-1.0, 0.0, 1.0]))
    limits = ("set_xlim", (0.0, 6.0), {}), ("set_ylim", (4.0, 1.0), {})
    ax, svg = svg_of(*limits, ("colorbar", (shades,), {"label": "force"}))
    low, high = (colours.colour_at("Blues", share) for share in (0.0, 1.0))
    assert f'<rect x="68.00" y="25.00" width="8.00" height="15.00" fill="{low}"' in svg
    assert f'<rect x="68.00" y="10.00" width="8.00" height="15.00" fill="{high}"' in svg
    assert 'x="79.0" y="28.5">0.0' in svg
    assert ax.right == pytest.approx(14 + len("-0.5") * 0.55 * 10 + 20)
    assert re.search(r'<text [^>]* transform="rotate\(-90 [^>]*><tspan [^>]*>force<', svg)


def test_a_panel_is_an_element_as_large_on_the_screen_as_its_letters_need():
    svg = sketched._svg("inside", (3.0, 4.0, 100.0, 50.0), FigureStyle(size=9.0), 'class="x"')
    assert 'width="180.0" height="90.0" viewBox="0 0 100.0 50.0"' in svg
    assert "min-width: 115px; max-width: 180px" in svg  # 9.2 pixels for letters of 8 points
    assert '{"x": 3.0, "y": 4.0, "width": 100.0, "height": 50.0}' in svg


def test_panels_stand_in_rows_of_three_or_of_two_if_they_are_four():
    panels = [drawing.Panel(str(k), lambda ax: ax.plot([0, 1]), "x", ("y",)) for k in range(7)]
    for count, columns in ((1, 1), (3, 3), (4, 2), (5, 3), (7, 3)):
        figure = drawing.Drawing("q", "", tuple(panels[:count]), drawing.Layout(2.0))
        plan = drawing.arranged(figure, style.PLAIN)
        assert (plan.columns, plan.width) == (columns, 3.5 if count == 1 else drawing.DOUBLE)
        narrow = drawing.arranged(figure, style.PLAIN, width=drawing.DOUBLE * 0.7)
        assert narrow.columns == max(1, int(columns * 0.7))
    assert 1 < drawing.Layout().height < 3
    # the space between the two columns of a page is small
    assert 0 < drawing.DOUBLE - 2 * 3.5 < 0.3


@pytest.mark.parametrize(
    ("count", "width", "columns"), [(5, 3.0, 5), (5, 2.0, 3), (4, 2.0, 2), (5, 1.0, 1), (5, 0.1, 1)]
)
def test_entries_of_a_legend_are_in_rows_of_nearly_equal_length(count, width, columns):
    """An entry with two letters of 8 points is 9.6 times 4.4 points, or 0.587 inches, wide."""
    assert drawing.legend_columns(["", *["ab"] * (count - 1)], width, 8.0) == columns


@pytest.mark.parametrize(("width", "columns", "wide"), [(3.5, 1, 0), (3.6, 1, 1), (7.0, 2, 0)])
def test_a_panel_of_one_column_of_a_journal_fits_on_a_narrow_screen(width, columns, wide):
    assert drawing.RenderedFigure("q", "", "", width, columns).is_wide == wide


def test_both_ways_of_drawing_have_the_same_margins_lines_and_dashes():
    ends = np.array([0.0, 1.0])
    panel = drawing.Panel("", lambda ax: ax.plot(ends), "x", ("y",))
    figure = drawing.Drawing("q", "", (panel,), drawing.Layout(2.0))
    svg = sketched.sketched(figure, style.PLAIN).svg
    axes_width = float(re.search(r'stroke="#000" stroke-width="([.\d]+)"', svg)[1])
    with style.figure_style():
        (ax,) = drawing.compose(figure).axes
        assert ax.margins() == (sketch.MARGINS["x"], sketch.MARGINS["y"])
        assert f'stroke-width="{ax.lines[0].get_linewidth():g}"' in elements.line_svg(
            ends, ends, {}
        )
        assert {
            rcParams[name] for name in ("axes.linewidth", "xtick.major.width", "ytick.major.width")
        } == {axes_width}
        for dashes, name in (("--", "dashed"), ("-.", "dashdot"), (":", "dotted")):
            assert list(elements.DASHES[dashes]) == rcParams[f"lines.{name}_pattern"]
        sides = {name for name, spine in ax.spines.items() if spine.get_visible()}
        assert sides == {"left", "bottom"}
        assert not ax.text(0, 0, "$x$").get_parse_math(), "a name may have dollar signs"


@pytest.mark.parametrize("count", [1, 2])
def test_both_ways_of_drawing_have_the_same_ticks(count):
    panels = [drawing.Panel(str(k), lambda ax: ax.plot([0, 1]), "x", ("y",)) for k in range(count)]
    ax = drawing.compose(drawing.Drawing("q", "", tuple(panels), drawing.Layout(2.0))).axes[0]
    (sheet,) = sketched._filled(panels[0].draw, [1.0], count, 7.0)
    for sketch_axis, axis in ((sheet.xaxis, ax.xaxis), (sheet.yaxis, ax.yaxis)):
        low, high = axis.get_view_interval()
        ticks = [at for at in axis.get_ticklocs() if low <= at <= high]
        assert ticks == pytest.approx([*sketch_axis.labels()])
