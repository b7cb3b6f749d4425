"""Which samples, curves and words a panel has, by hand."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of
from report_builder import Recorder

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.reporting.figures import fit, panels, sketched, style
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.sketch import Sketch
from mapmore_cli.reporting.inputs import ReportInputs


def test_dots_are_evenly_spread_with_the_extremes_among_them():
    assert panels.evenly(10, 4) == [0, 3, 6, 9]
    assert panels.evenly(3, 4) == [0, 1, 2]
    y = np.array([np.nan, 0, 0, -9.0, 0, 0, 0, 0, 8, 0, np.inf])
    assert panels.cloud(y, 9).tolist() == [*range(1, 10)]
    assert panels.cloud(y, 8).tolist() == [1, 3, 4, 6, 7, 8, 9]
    assert panels.cloud(y, 4).tolist() == [1, 3, 8, 9]


def test_long_lines_are_means_and_ranges_of_equal_stretches():
    x = np.linspace(10, 160, 601)  # four samples in each of 150 stretches
    y = np.where(np.arange(601) % 2, 1.0, -2.0)
    middle, mean, low, high = panels.band(x, y)
    assert len(middle) == 150
    assert middle[:2] == pytest.approx([10.375, 11.375])
    assert middle[-1] == pytest.approx(159.5)
    assert mean[:-1] == pytest.approx(-0.5)
    assert (low == -2).all()
    assert (high == 1).all()
    gap = np.where((x < 20) | (x > 30), y, np.nan)
    assert len(panels.band(x, gap)[0]) == 150 - 10
    assert panels.band(x, np.where(x < 11, np.nan, y))[0][0] == pytest.approx(11.375)
    far = panels.band(np.append(x, 310), np.append(y, 0.0))[0]
    assert (far[0], far[-1]) == pytest.approx((10.875, 310))


@pytest.mark.parametrize(("samples", "filled"), [(600, 0), (601, 1)])
def test_a_line_has_a_band_with_more_than_four_samples_in_each_stretch(samples, filled):
    drawn = []
    ax = SimpleNamespace(
        fill_between=lambda x, *_ends, alpha, **_look: drawn.append(len(x) * (0 < alpha < 0.5)),
        plot=lambda x, _y, **_look: drawn.append(len(x)),
    )
    x = np.linspace(0, 1, samples)
    panels.draw_band(ax, x, x, color="red")
    assert drawn == [150] * filled + [150 if filled else samples]


def test_captions_say_what_is_left_out():
    assert panels.thinned([3, 200]) == ""
    assert panels.thinned([201, 3]) == panels.SOME_DOTS
    assert panels.thinned([600]) == panels.SOME_DOTS
    assert "pale bands" in panels.thinned([3, 601])
    assert (panels.some_of(3, 3, "x"), panels.best_of(3, 3)) == ("", "")
    assert panels.some_of(2, 3, "curves") == " 2 of 3 curves are drawn, evenly spread."
    assert "own and the best other are" in panels.best_of(2, 4)
    assert "own and the best 2 others are" in panels.best_of(3, 4)


def test_curves_that_were_asked_for_are_drawn_otherwise_six_evenly():
    curves = [SimpleNamespace(id=f"c{number}") for number in range(20)]
    inputs = SimpleNamespace(asked=(), dataset=SimpleNamespace(curves=curves))
    ids = [curve.id for curve in curves]
    assert panels.places(inputs, ids[:6]) == [*range(6)]
    assert panels.places(inputs, ids[:11]) == [0, 2, 4, 6, 8, 10]
    assert panels.places(inputs, ids, 2) == [0, 19]
    assert panels.some_curves(inputs, [4, 5, 9], 2) == [4, 9]
    inputs.asked = ("c5", "c9", "c11")
    assert panels.some_curves(inputs, [4, 5, 9], 1) == [5, 9]


@pytest.mark.parametrize(
    ("names", "length", "shown"),
    [
        (["abcdefgh"], 8, ["abcdefgh"]),
        (["abcdefghi"], 8, ["abc…fghi"]),
        (["abcdefghi"], 7, ["abc…ghi"]),
        (["abcdefghi"], 2, ["…i"]),
        (["run_a", "run_b"], 5, ["run_a", "run_b"]),
        (["run_a", "run_b"], 4, ["…a", "…b"]),
        (["run_a", "run_bcdef"], 5, ["…a", "…b…ef"]),
        (["long_a_end", "long_bb_end"], 6, ["…a_…", "…bb_…"]),
        (["run aaaaaaaa1aaaa", "run aaaaaaaa2aaaa"], 8, ["1: …a…aa", "2: …a…aa"]),
        (["same_name", "same_name"], 5, ["sa…me", "sa…me"]),
    ],
)
def test_names_are_shortened_so_that_they_stay_different(names, length, shown):
    assert panels.told_apart(names, length) == shown


def test_powers_are_raised_and_names_are_in_lines():
    assert panels.raised("x^2*y^13 + z^1.5 + x^-1") == "x²*y¹³ + z^1.5 + x^-1"
    assert panels.titles(["one two", "three"], 4) == ["one\ntwo", "thre\ne"]


def test_sheets_of_a_panel_share_its_height_and_its_right_end(monkeypatch):
    axes, words = [], []
    monkeypatch.setattr(sketched, "_axes", lambda *asked: axes.append(asked) or "")
    monkeypatch.setattr(sketched, "text", lambda *asked: words.append(asked) or "")
    sheets = [SimpleNamespace(right=right, share=share) for right, share in ((0, 2.0), (30, 0.5))]
    panel = SimpleNamespace(y_labels=("y",), x_label="x")
    sketched._panel(sheets, panel, "title", (40.0, 20.0, 200.0, 151.7), SimpleNamespace(size=9))
    # below the axes are 8 + 3 + 1.3 9 points and 4 of margin, and 7 between the sheets
    height = 151.7 - (8 + 3 + 11.7) - 4 - 20 - 7
    first = 20 + height * 2 / 2.5
    assert [one[1] for one in axes] == [
        (40, 164, 20, pytest.approx(first)),
        (40, 164, pytest.approx(first + 7), pytest.approx(first + 7 + height / 5)),
    ]
    assert [one[2:] for one in axes] == [("y", 40, False), ("", 40, True)]
    assert words[0] == ("title", 40, 16, 8)
    assert words[1][:2] == ("x", 102)
    assert words[1][2] == pytest.approx(151.7 - 4)
    sketched._panel(sheets[:1], panel, "", (40.0, 20.0, 200.0, 151.7), SimpleNamespace(size=9))
    assert axes[-1][1] == (40, 194, 20, pytest.approx(20 + height + 7))
    assert len(words) == 3


def test_entries_of_a_legend_fill_lines_from_the_left(monkeypatch):
    places = []
    monkeypatch.setattr(sketched, "_svg", lambda _inside, place, *_: places.append(place) or "x")
    entries = [("a", 300.0), ("b", 100.0), ("c", 182.0), ("d", 10.0)]
    found, height = sketched._legend(entries, 4.0, SimpleNamespace(size=9))
    line = 1.4 * 8
    # a line has 288 points, which two entries fill; two entries are 6 points apart
    assert [place[:3] for place in places] == [
        (0, 0, 300), (0, line, 100), (106, line, 182), (0, 2 * line, 10),
    ]  # fmt: skip
    assert (found, height) == ("xxxx", 3 * line)
    assert sketched._legend([], 4.0, SimpleNamespace(size=9)) == ("", 0)


def test_an_entry_of_a_legend_is_a_sample_two_letters_wide_before_its_words():
    """For letters of 8 points: a line in the middle of their height, or a box as high as they."""
    entry = partial(sketched._entry, "ab cd", style=SimpleNamespace(size=9))
    line, width = entry({"color": "#000", "marker": "o", "markeredgewidth": 0})
    assert width == pytest.approx((5 * 0.62 + 4.5) * 8)
    assert '<path d="M1 5.2l16 0" fill="none" stroke="#000"' in line
    assert '<path d="M9 5.2h0"' in line
    assert 'x="21.0" y="8.0">ab cd' in line
    box, _ = entry({"facecolor": "#00f", "alpha": 0.25})
    assert '<rect x="1.00" y="2.40" width="16.00" height="5.60" fill="#00f"' in box
    assert 'fill-opacity="0.25"' in box


def test_panels_below_each_other_begin_at_the_same_place_below_the_highest_heading(monkeypatch):
    """Four panels stand in two columns; the heading of one has two lines."""
    frames, places, room = [], [], iter([10.0, 20.0, 30.0, 15.0])
    monkeypatch.setattr(sketched, "_room_left", lambda *_: next(room))
    monkeypatch.setattr(sketched, "_panel", lambda *asked: frames.append(asked[3]) or "")
    monkeypatch.setattr(sketched, "_svg", lambda _inside, place, *_: places.append(place) or "")
    names = ("a", "b", " ".join(["word"] * 10), "d")
    four = [Panel(name, lambda ax: ax.plot([0, 1]), "x", ("y",), title=name) for name in names]
    figure = sketched.sketched(Drawing("q", "", tuple(four), Layout(2.0, width=5.0)), style.PLAIN)
    size, width, height = style.PLAIN.size - 1, 2.5 * 72, 2.0 * 72
    assert [frame[0] for frame in frames] == [30, 20, 30, 20]
    for _, *frame in frames:
        assert frame == [pytest.approx(2 * 1.2 * size + 4), width, height]
    assert places == [(x, y, width, height) for y in (0, height) for x in (0, width)]
    assert f'"viewBox": "0 0 360.0 {2 * height:.1f}"' in figure.svg
    assert (figure.width, figure.columns) == (5.0, 2)


def test_sheets_share_the_x_axis_and_have_fewer_ticks_beside_each_other():
    for columns, stack, ticks in ((1, [1.0], (5, 6)), (2, [2.0, 0.5], (4, 4))):
        sheets = sketched._filled(lambda *_: None, stack, columns, 8.0)
        assert [sheet.share for sheet in sheets] == stack
        assert all(sheet.xaxis is sheets[0].xaxis for sheet in sheets)
        assert {(sheet.xaxis.most, sheet.yaxis.most) for sheet in sheets} == {ticks}


def axis_of(labels, scale):
    return SimpleNamespace(
        labels=lambda: labels, scale=lambda start, end: lambda at: scale(start, end, at)
    )


def test_rows_are_labelled_from_the_top_and_powers_of_ten_on_a_logarithmic_axis():
    ax = Sketch(7.0)
    panels.label_rows(ax, ["first", "second"])
    panels.plain_logarithm(ax, "x")
    ax.set_xlim(0.01, 1.0)
    assert ax.yaxis.labels() == {0: "first", 1: "second"}
    assert ax.yaxis.ends == pytest.approx((1.5, -0.5), abs=0.1)
    assert [*ax.xaxis.labels().values()] == ["0.01", "0.1", "1"]


def test_room_for_the_labels_of_the_longest_line():
    sheets = [
        SimpleNamespace(yaxis=SimpleNamespace(labels=lambda words=words: {0: words}))
        for words in ("100", "1\n2222")
    ]
    for labels in (["y\nunit", "z", ""], ["z", "y\nunit"]):
        room = 4 * 0.62 * 8 + 6 + 2 * 10.5
        assert sketched._room_left(sheets, labels, 8.0) == pytest.approx(room)
    assert sketched._room_left(sheets[:1], [""], 8.0) == pytest.approx(3 * 0.62 * 8 + 6)
    assert sketched._width("i") < sketched._width("m") == sketched._width("W") <= 1


@pytest.mark.parametrize("last", [True, False])
def test_axes_have_ticks_at_their_labels(last, monkeypatch):
    words = []
    monkeypatch.setattr(sketched, "text", lambda *asked, **look: words.append((asked, look)) or "")

    def straight(start, end, at):
        return start + (end - start) * at

    marks = [(2, lambda _x, _y: "late"), (1, lambda across, up: f"{across(1):g} {up(1):g};")]
    sheet = SimpleNamespace(
        xaxis=axis_of({0.25: "a"}, straight), yaxis=axis_of({0.5: "b\nc"}, straight),
        marks=marks, beside=[(0, lambda _x, _y: "beside")], size=8.0,
    )  # fmt: skip
    svg = sketched._axes(sheet, (40.0, 140.0, 20.0, 100.0), "y\nunit", 35.0, last)
    assert '<svg x="40.0" y="20.0" width="100.0" height="80.0"' in svg
    assert 'viewBox="40.0 20.0 100.0 80.0">140 20;late</svg>' in svg
    assert "M40.0 20.0V100.0H140.0M65.0 100.0v2.5M40.0 60.0h-2.5" in svg
    assert svg.endswith("beside")
    below = [(("a", 65, 111, 8, "middle"), {})] * last
    beside = (("b\nc", 36, pytest.approx(60 + 8 * 0.93), 8, "end"), {})
    label = (("y\nunit", pytest.approx(40 - 35 + 8 + 9.2), 60, 9, "middle"), {"turned": True})
    assert words == [*below, beside, label]


def test_the_models_of_a_figure():
    models = ("own", "mean", *"abcdefgh", "cubic", "arx")
    errors = {"own": 1.0, **{name: 2.0 + k for k, name in enumerate("abcdefgh")}, "cubic": 1.5}
    inputs = SimpleNamespace(
        models=models, own="own", pooled_errors=errors | {"h": 10.0, "g": 10.1}
    )
    assert ReportInputs.far_off.fget(inputs) == ("g",)
    inputs.shown = ReportInputs.shown.fget(inputs)
    assert inputs.shown == ("own", "mean", *"abcdefgh", "cubic")  # the best of the simple ones
    inputs.best = partial(ReportInputs.best, inputs)
    assert inputs.best(3) == ("own", "a", "cubic")
    assert ReportInputs.lines.fget(inputs) == ("own", *"abcde", "cubic")
    inputs.pooled_errors = {"own": 0.0, "a": 1.0}
    assert ReportInputs.far_off.fget(inputs) == ()


def test_intervals_belong_to_the_output_of_the_model_and_to_no_other_quantity():
    force, strain = Quantity("force", "N"), Quantity("strain", "1")
    model = SimpleNamespace(output=force, left_out="errors")
    for target, left_out in ((force, "errors"), (strain, None)):
        inputs = SimpleNamespace(model=model, target=target)
        assert ReportInputs.left_out.fget(inputs) == left_out


@pytest.mark.parametrize(("runs", "spans"), [(6, 6), (7, 0)])
def test_at_most_six_runs_of_held_out_samples_are_shaded(runs, spans):
    held_out = np.arange(16) % 2 == 1
    held_out[2 * runs :] = False
    assert len(fit.held_out_spans(np.arange(16.0), held_out)) == spans
    assert fit.held_out_spans(np.arange(3.0), np.ones(3, dtype=bool)) == []


def test_plateaus_reach_from_the_first_to_the_last_sample_at_rest():
    curve = replace(
        curve_of({"time": np.array([0.0, 1, 2, 3, 0, 1])}),
        at_rest=np.array([0, 1, 1, 1, 0, 0], dtype=bool),
        origin=np.array([0, 0, 0, 0, 1, 1]),
        recordings=("a", "b"),
    )
    assert fit._plateaus(curve) == [(1, 3)]
    assert fit._plateaus(replace(curve, at_rest=None)) == []


@pytest.mark.parametrize("timed", [False, True])
def test_a_fit_has_measured_samples_and_lines_above_and_errors_below(timed, monkeypatch):
    for name in ("draw_line", "draw_trace", "draw_band", "draw_dots"):
        monkeypatch.setattr(
            panels, name,
            lambda ax, x, y, *, label, name=name, sets_scale=True, **look: ax.calls.append(
                (name, x.tolist(), np.nan_to_num(y, nan=-1).tolist(), label, sets_scale,
                 look.get("markerfacecolor"))
            ),
        )  # fmt: skip
    monkeypatch.setattr(
        panels, "shade_between",
        lambda ax, _x, ends, _colour, label: ax.calls.append(("band", *map(list, ends), label)),
    )  # fmt: skip
    x, y, own = np.array([0.0, 1, 2]), np.array([5.0, 6, 7]), np.array([5.5, 6, 6])
    models = {"mapmore": own, "far": 9 * y, "failed": np.full(3, np.nan)}
    drawn = fit.CurveFit(
        "title", x, y, np.array([False, True, False]), models, style.model_styles([*models], ()),
        ["far"], (own - 1, own + 2), [np.arange(3)] if timed else (), [(0.5, 1.5)],
    )  # fmt: skip
    top, bottom = Recorder(), Recorder()
    drawn.draw(top, bottom, ("held out", "training"))
    line = "draw_trace" if timed else "draw_band"
    if timed:
        measured = [
            ("draw_trace", [0, 1, 2], [-1, 6, -1], "held out", True, None),
            ("draw_trace", [0, 1, 2], [5, -1, 7], "training", True, None),
        ]
    else:
        measured = [
            ("draw_dots", [1], [6], "held out", True, style.BLACK),
            ("draw_dots", [0, 2], [5, 7], "training", True, "none"),
        ]
    shade = {"color": style.SHADE, "zorder": -1, "linewidth": 0}
    span = ("axvspan", (0.5, 1.5), shade | {"label": "plateau" if timed else ""})
    look = {"color": drawn.looks["failed"].colour, "label": "failed (failed)"}
    failed = ("plot", ([], [], "x"), look)
    assert top.calls == [
        *measured,
        (line, [0, 1, 2], [5.5, 6, 6], "mapmore", True, None),
        (line, [0, 1, 2], [45, 54, 63], "far", False, None),
        failed,
        ("band", [4.5, 5, 5], [7.5, 8, 8], "95% interval"),
        span,
    ]
    assert bottom.calls == [
        ("axhline", (0,), {"color": style.GREY, "linewidth": 0.5, "zorder": 0}),
        (line, [0, 1, 2], [0.5, 0, -1], "mapmore", True, None),
        (line, [0, 1, 2], [40, 48, 56], "far", False, None),
        failed,
        ("band", [-1, -1, -1], [2, 2, 2], "95% interval"),
        span,
    ]
