"""Quick drawings: what they show, and that a page needs no Matplotlib for them."""

import math
import re
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from report_builder import build
from test_memory_report import report_of

from mapmore_cli.modelling.kinds import outside_range
from mapmore_cli.reporting.figures.axis import Axis, levels_of, nice_ticks
from mapmore_cli.reporting.figures.contours import outlines_above
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel, drawings, render_figure
from mapmore_cli.reporting.figures.panels import key
from mapmore_cli.reporting.figures.sketch import Sketch
from mapmore_cli.reporting.figures.sketched import _share_axes, sketched
from mapmore_cli.reporting.figures.style import PLAIN
from mapmore_cli.reporting.figures.surface import plane_of, sheet_of
from mapmore_cli.reporting.inputs import FigureStyle
from mapmore_cli.reporting.order import FIGURES, FILES_ALONE
from mapmore_cli.reporting.report import data_csv, numbers_of


@pytest.fixture(scope="module")
def inputs():
    return build()


def texts(svg):
    return [
        "".join(one.itertext()) for one in ElementTree.fromstring(svg).iter() if "text" in one.tag
    ]


def assert_fine(drawing, svg):
    """Lines are thin, dots are small, nothing is more than opaque, and every axes is high enough to
    be read and low enough for a page.
    """
    strokes = re.findall(r'stroke-width="([.\d]+)"( stroke-linecap)?', svg)
    assert max((float(width) for width, dots in strokes if not dots), default=0.0) <= 2
    dots = [float(width) for width, dots in strokes if dots]
    assert max([*dots, *(2 * float(r) for r in re.findall(r' r="([.\d]+)"', svg))], default=0) <= 5
    assert max(map(float, re.findall(r'opacity="([.\d]+)"', svg)), default=0.0) <= 1
    heights = drawing.grid.height * np.divide(drawing.grid.stack, sum(drawing.grid.stack))
    assert 0.5 <= heights[-1] <= max(heights) == heights[0] <= 3


@pytest.mark.parametrize("name", ["fit", "residuals", "error", "data"])
def test_lines_and_dots_over_time_are_fine(name):
    running = report_of(["pressure", "motion[k-1]"])
    for drawing in drawings(name, running):
        assert_fine(drawing, sketched(drawing, running.style).svg)


@pytest.mark.parametrize("name", sorted(FIGURES.keys() - FILES_ALONE))
def test_every_figure_of_a_page_is_a_quick_drawing(inputs, name):
    for drawing in drawings(name, inputs):
        figure = sketched(drawing, inputs.style)
        assert_fine(drawing, figure.svg)
        words = texts(figure.svg)
        for panel in drawing.panels:
            assert panel.x_label in words
        baselines = map(float, re.findall(r'<tspan x="[^"]*" y="([^"]*)"', figure.svg))
        assert min(baselines) >= inputs.style.size - 1, "letters lie within their panel"
        assert not {"nan", "inf"} & {*figure.svg.replace('"', " ").split()}


def test_a_page_does_not_load_matplotlib(tmp_path):
    code = (
        "import sys; sys.path.insert(0, 'tests/reporting'); from report_builder import build\n"
        "from pathlib import Path; from mapmore_cli.reporting.report import write_report\n"
        "from mapmore_cli.reporting.order import FIGURES\n"
        f"write_report(build(), Path({str(tmp_path)!r}), FIGURES, ['html', 'csv'])\n"
        "assert 'matplotlib' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert (tmp_path / "index.html").read_text(encoding="utf-8").count("<figure") > 8


def test_what_a_sketch_does_not_know_is_drawn_by_matplotlib():
    def on(ax):
        ax.quiver([0.0], [0.0], [1.0], [1.0])

    assert sketched(Drawing("q", "", (Panel("", on, "x", ("y",)),), Layout()), PLAIN) is None


def test_words_that_are_formulas_are_set_by_matplotlib():
    drawing = Drawing("q", "", (Panel("", lambda ax: ax.plot([0, 1]), "x", ("y",)),), Layout())
    assert sketched(drawing, PLAIN) is not None
    assert sketched(drawing, FigureStyle(labels={"force": "$F$ (N)"})) is None


def test_places_are_true_to_the_numbers():
    """Matplotlib's own axes say where a number stands: the same share of the axis."""
    axis = Axis(0.05)
    axis.hold([2.0, np.nan, 10.0])
    assert axis.ends == pytest.approx((1.6, 10.4))
    assert axis.scale(100.0, 0.0)([1.6, 6.0, 10.4]) == pytest.approx([100.0, 50.0, 0.0])
    axis = Axis(0.0, limits=(0.1, 1000.0), logarithmic=True)
    assert axis.scale(0.0, 4.0)([0.1, 1.0, 1000.0]) == pytest.approx([0.0, 1.0, 4.0])
    assert [*axis.labels().values()] == ["0.1", "1", "10", "100", "1000"]


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (0.0, 1.0, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        (-120.0, 60.0, ["−100", "−50", "0", "50"]),
        (0.0, 0.3, ["0.0", "0.1", "0.2", "0.3"]),
        (0.0, 1e-7, ["0", "2e-08", "4e-08", "6e-08", "8e-08", "1e-07"]),
        (2e-5, 4e-5, ["2e-05", "2.5e-05", "3e-05", "3.5e-05", "4e-05"]),
        (0.0, 1e-4, ["0.00000", "0.00002", "0.00004", "0.00006", "0.00008", "0.00010"]),
        (0.0, 1e6, ["0", "200000", "400000", "600000", "800000", "1e+06"]),
        (0.3, 0.1 + 0.2, ["0.3"]),  # ends that differ by rounding alone
        (1.0, 3.2, ["1.0", "1.5", "2.0", "2.5", "3.0"]),
        (0.0, 10.0, ["0.0", "2.5", "5.0", "7.5", "10.0"]),
    ],
)
def test_ticks_are_round_numbers(low, high, ticks):
    most = 4 if high == 10.0 else 5
    assert [*Axis(0.0, limits=(low, high), most=most).labels().values()] == ticks


@pytest.mark.parametrize(
    ("values", "ends"), [([0.0, 2.0, 8.0], (2, 8)), ([0.0, -1.0], (1, 10)), ([4.0], (2, 8))]
)
def test_a_logarithmic_axis_begins_at_the_least_positive_value(values, ends):
    """Also if it becomes logarithmic only after its values are known."""
    axis = Axis(0.0)
    axis.hold(values)
    axis.logarithmic = True
    assert axis.ends == ends


@pytest.mark.parametrize(
    ("margin", "values", "logarithmic", "ends"),
    [
        (0.1, [], False, (0, 1)),
        (0.1, [np.inf, 3.0, -2.0], False, (-2.5, 3.5)),
        (0.1, [40.0, 40.0], False, (38, 42)),  # a twentieth beside a single value
        (0.1, [-40.0], False, (-42, -38)),
        (0.1, [0.0], False, (-1, 1)),
        (0.0, [3.0, 5.0], False, (3, 5)),
        (0.0, [40.0], False, (38, 42)),
        (0.5, [1.0, 100.0], True, (0.1, 1000)),
        (0.1, [7.0], True, (3.5, 14)),
        (0.1, [-7.0, np.nan], True, (1, 10)),
    ],
)
def test_an_axis_has_room_beside_its_values(margin, values, logarithmic, ends):
    axis = Axis(margin, logarithmic=logarithmic)
    for value in values:
        axis.hold([value])
    assert axis.ends == pytest.approx(ends, rel=1e-12)
    axis.set_ends(None, 1e3)
    assert axis.ends == pytest.approx((ends[0], 1e3))
    axis.set_ends(-1.0, None)
    assert axis.ends == (-1.0, 1e3)


def test_own_ticks_are_on_the_axis_and_named_by_their_numbers():
    axis = Axis(0.1)
    axis.set_ticks([1.0, 2.5, 4.0], None)
    assert axis.ends == pytest.approx((0.7, 4.3))
    axis.set_ends(4.0, 2.5)  # the other way round
    assert axis.labels() == {2.5: "2.5", 4.0: "4"}
    axis.set_ticks([3.0], ["three"])
    assert axis.labels() == {3.0: "three"}
    fine = Axis(0.0, limits=(0.5, 25.0), logarithmic=True, subs=(1.0, 2.0, 5.0))
    assert [*fine.labels().values()] == ["0.5", "1", "2", "5", "10", "20"]
    large = Axis(0.0, limits=(0.0, 2e6))
    assert [*large.labels().values()] == ["0", "500000", "1e+06", "1.5e+06", "2e+06"]


def test_ticks_are_as_many_as_there_is_room_for():
    """The smallest of the round steps with which there are not too many."""
    rng = np.random.default_rng(5)
    for _ in range(400):
        low = rng.normal() * 10.0 ** rng.integers(-8, 8)
        high, most = low + 10.0 ** rng.uniform(-6, 6), int(rng.integers(2, 13))
        if high - low < 1e-9 * abs(low):
            continue
        powers = 10.0 ** np.arange(-9, 9)
        steps = sorted(digit * power for power in powers for digit in (1, 2, 2.5, 5))
        step = next(step for step in steps if (high - low) / step <= most)
        numbers = range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
        assert nice_ticks(low, high, most) == pytest.approx([n * step for n in numbers], rel=1e-9)
        around = range(math.floor(low / step), math.ceil(high / step) + 1)
        if len(numbers) > 1:
            assert levels_of(low, high, most) == pytest.approx([n * step for n in around], rel=1e-9)


def test_a_single_value_is_a_tick_and_a_level():
    assert levels_of(5.0, 5.0, 4) == [5.0]
    for value in (5.0, 0.0, -5.0):
        assert nice_ticks(value, value, 4) == [value]
    assert nice_ticks(1.0, math.nextafter(1.0, 2.0), 4) == [1.0]  # differ by rounding alone


def test_marks_keep_their_order_and_gaps():
    ax = Sketch(7.0)
    ax.plot([0.0, 1.0, 2.0, 3.0], [0.0, np.nan, 1.0, 2.0], color="#123456", label="a", zorder=3)
    ax.axhline(0.5, color="0.3", zorder=0)
    assert [order for order, _ in ax.marks] == [3, 0]
    svg = ax.marks[0][1](ax.xaxis.scale(0, 100), ax.yaxis.scale(100, 0))
    assert re.findall("[a-zM]", re.search(' d="(.*?)"', svg)[1]) == ["M", "m", "l"]
    assert [*ax.keys] == ["a"]


def test_a_legend_of_its_own_and_names_that_are_markup():
    panel = Panel("", lambda ax: ax.plot([0.0, 1.0], label="left out"), "<b>x & y", ("y",))
    drawing = Drawing("q", "", (panel,), Layout(), [key("<i>solid", facecolor="#00f", hatch=None)])
    words = texts(sketched(drawing, PLAIN).svg)
    assert {"<b>x & y", "<i>solid"} <= {*words}
    assert "left out" not in words


@pytest.mark.parametrize("name", ["surface", "residual_map"])
def test_colours_of_a_map_are_named_in_both_ways_of_drawing(inputs, name):
    """On a dark page, figures are inverted, and what has this class is inverted twice."""
    (drawing,) = drawings(name, inputs)
    for figure in (sketched(drawing, inputs.style), render_figure(drawing, inputs.style)):
        assert figure.svg.count('class="map"') >= 2


def test_a_region_ends_where_its_quantity_crosses_the_level():
    """Of a plane the straight line, at the rim the rim itself; what is no number is left out."""
    heights = np.linspace(0.0, 1.0, 5)
    x = np.linspace(np.zeros(5), 2.0 + heights, 9, axis=1)  # each row up to its own rim
    (outline,) = outlines_above(x, heights, x + heights[:, None], 1.1)
    across, up = map(np.array, outline)
    left = slice(0, 5)
    assert across[left] + up[left] == pytest.approx(1.1)
    assert across[5:] == pytest.approx(2.0 + up[5:])
    parted = np.where(heights[:, None] == 0.5, np.nan, 5.0 + 0 * x)
    regions = outlines_above(x, heights, parted, 1.1)
    assert [(min(up), max(up)) for _, up in regions] == [(0.0, 0.375), (0.625, 1.0)]
    assert outlines_above(x, heights, np.full(x.shape, np.nan), 1.1) == []
    peak = np.array([[-20.0, 0.0, 5.0, 0.0, -20.0]] * 2)  # crossed halfway to the next neighbours
    ((across, _),) = outlines_above(np.array([np.arange(5.0)] * 2), np.arange(2.0), peak, 2.5)
    assert across == [1.5, 1.5, 2.5, 2.5]
    level_ground = outlines_above(np.array([[0, 1, 2]] * 2), np.arange(2), np.zeros((2, 3)), 0)
    assert level_ground == [([0, 0, 2, 2], [0, 1, 1, 0])]


def test_the_rim_of_a_surface_is_that_of_the_training_range(inputs):
    """No stairs: every row ends where the model begins to be extrapolated."""
    sheet, model = sheet_of(inputs), inputs.model
    for side, step in ((0, -1), (-1, 1)):
        known = np.isfinite(sheet.output[:, side])
        ends = sheet.across[known, side]
        for shift, beyond in ((0.0, False), (1e-4 * step, True)):
            at = {"strain": ends + shift, "pressure": sheet.up[known, side]}
            assert (outside_range(model, at) == beyond).all()
        assert known.sum() > 50


def test_there_is_no_surface_if_a_curve_lacks_an_input(inputs):
    first, *others = inputs.dataset.curves
    columns = {name: x for name, x in first.columns.items() if name != "strain"}
    lacking = replace(inputs.dataset, curves=(*others, replace(first, columns=columns)))
    assert plane_of(inputs).names == ("strain", "pressure")
    assert plane_of(replace(inputs, whole=lacking)) is None


@pytest.mark.parametrize(
    ("all_x", "common_y", "x", "y"),
    [
        (True, "row", [(-1, 5)] * 3, [(0, 9), (0, 9), (4, 5)]),
        (False, "all", [(0, 1), (-1, 2), (3, 5)], [(0, 9)] * 3),
        (False, "none", [(0, 1), (-1, 2), (3, 5)], [(2, 3), (0, 9), (4, 5)]),
    ],
)
def test_shared_axes_reach_from_the_lowest_to_the_highest_end(all_x, common_y, x, y):
    """Two panels in the first row, one in the second."""
    ends = [((0, 1), (2, 3)), ((-1, 2), (0, 9)), ((3, 5), (4, 5))]
    names = ("xaxis", "yaxis")
    panels = [
        [
            SimpleNamespace(
                **{name: Axis(0.0, low, high) for name, (low, high) in zip(names, one, strict=True)}
            )
        ]
        for one in ends
    ]
    _share_axes(panels, 2, all_x, common_y)
    for name, expected in zip(names, (x, y), strict=True):
        axes = [getattr(sheet, name) for (sheet,) in panels]
        assert [(axis.low, axis.high) for axis in axes] == expected


def test_names_in_the_numbers_of_a_figure_are_no_formulas():
    """Of a spreadsheet; numbers have six digits, and a missing one is empty."""
    data = {"=x": np.array([1 / 3, np.nan]), "data": np.array(["train", "=1+1"])}
    panel = Panel("=a", lambda _ax: None, "x", ("y",), data)
    text = numbers_of(Drawing("q", "", (panel,), Layout()))
    assert data_csv({"x": np.array([1 / 3, 2.0])}) == "x\n0.333333333333\n2\n"  # twelve in files
    assert text == "panel,'=x,data\n'=a,0.333333,train\n'=a,,'=1+1\n"
