"""Where a shape is required, between which samples the output is interpolated, and which values a
stencil compares: against sums and searches that are written out.
"""

from itertools import product
from math import floor
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from mapmore_cli.domain.recording import CurveRange
from mapmore_cli.modelling.ranges import limits, outside_limits
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.modelling.shape.exchange import _grid_about, _widened
from mapmore_cli.modelling.shape.region import region_within
from mapmore_cli.modelling.shape.stencils import (
    POINTS,
    ShapeWord,
    asked_of,
    nodes_of,
    stencil_weights,
    stencils_on,
)
from mapmore_cli.modelling.shape.support import _axes, _confirmed, _near, _noise


def region_of(columns, fit=None, ranges=None, level=None):
    """The region of the output y of one curve along its other columns."""
    names = [name for name in columns if name != "y"]
    ends = {name: (columns[name].min(), columns[name].max()) for name in names}
    whole = tuple(limits(ranges or [CurveRange("all", None, ends)], level))
    return region_within(whole, [curve_of(columns)], "y", names, fit or Fit())


@given(st.sampled_from([1, 2, 3, 7]), st.integers(0, 10_000))
def test_cells_are_means_of_the_samples_in_a_part_of_each_range(inputs, seed):
    """4096 parts of all ranges together, but at least four along an input."""
    rng = np.random.default_rng(seed)
    parts = max(4096 ** (1 / inputs), 4)
    columns = {f"x{i}": 5 + 20 * rng.random(60).round(2) for i in range(inputs)}
    columns |= {"still": np.full(60, 7.0), "y": rng.normal(size=60)}
    cells = {}
    for row in range(60):
        place = []
        for i in range(inputs):
            x = columns[f"x{i}"]
            place.append(floor((x[row] - x.min()) / np.ptp(x) * parts))
        cells.setdefault(tuple(place), []).append(row)
    region = region_of(columns)
    assert (region.names, list(region.fixed)) == (tuple(f"x{i}" for i in range(inputs)), ["still"])
    assert region.fixed["still"].tolist() == [7.0]
    rows = [cells[place] for place in sorted(cells)]
    np.testing.assert_allclose(region.counts, [len(row) for row in rows])
    np.testing.assert_allclose(region.values, [columns["y"][row].mean() for row in rows])
    for i in range(inputs):
        means = [columns[f"x{i}"][row].mean() for row in rows]
        np.testing.assert_allclose(region.places[:, i], means)
    assert region.span == np.ptp(region.values)
    assert region_of({**columns, "y": np.ones(60)}) is None
    assert region_of({"still": np.full(60, 7.0), "y": columns["y"]}) is None


@pytest.mark.parametrize("inputs", [2, 3])
def test_the_output_is_linear_between_samples_and_that_of_the_nearest_outside(inputs):
    rng = np.random.default_rng(inputs)
    scales = np.array([1.0, 300.0, 0.02])[:inputs]
    x = rng.random((20, inputs)) * scales + 10 * scales
    names = [f"x{i}" for i in range(inputs)]
    slope = np.array([3.0, -0.01, 50.0])[:inputs]
    region = region_of(dict(zip(names, x.T, strict=True)) | {"y": 4 + x @ slope})
    at = (rng.random((200, inputs)) * 1.4 - 0.2) * scales + 10 * scales
    columns = dict(zip(names, at.T, strict=True))
    weights, inside = region.between(columns)
    low, width = region.places.min(axis=0), np.ptp(region.places, axis=0)
    cells, asked = (region.places - low) / width, (at - low) / width
    hull = ConvexHull(cells).equations
    assert inside.tolist() == ((asked @ hull[:, :-1].T + hull[:, -1]).max(axis=1) < 1e-9).tolist()
    assert 10 < inside.sum() < 190
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    assert weights.toarray().min() > -1e-9
    output = region.output(columns)
    np.testing.assert_allclose(output[inside], (4 + at @ slope)[inside])
    apart = ((asked[:, None] - cells) ** 2).sum(axis=2)
    np.testing.assert_allclose(output[~inside], region.values[apart.argmin(axis=1)][~inside])


def test_along_one_input_the_output_is_a_polyline_and_on_a_line_that_of_the_nearest():
    rng = np.random.default_rng(8)
    x = rng.permutation(np.cumsum(rng.random(30) + 0.1))
    region = region_of({"x": x, "y": rng.normal(size=30)})
    at = np.linspace(x.min() - 3, x.max() + 3, 101)
    order = np.argsort(region.places[:, 0])
    expected = np.interp(at, region.places[order, 0], region.values[order])
    np.testing.assert_allclose(region.output({"x": at}), expected)
    assert region.between({"x": at})[1].all()
    x = rng.permutation(30) * 1.0
    line = region_of({"x": x, "z": 2 * x, "y": x**2})
    weights, inside = line.between({"x": x, "z": 2 * x})
    assert not inside.any()
    np.testing.assert_allclose(weights @ line.values, x**2)


LEVELS = [
    CurveRange("a", 100.0, {"strain": (0.0, 0.1), "load": (1.0, 3.0)}),
    CurveRange("b", 300.0, {"strain": (0.02, 0.3), "load": (1.0, 7.0)}),
]


def by_levels():
    """Ranges by level, of a curve that reaches into all corners."""
    rows = list(product((100.0, 200.0, 300.0), np.linspace(0, 0.3, 5), (1.0, 4.0, 7.0)))
    p, s, q = np.array(rows).T
    return {"pressure": p, "strain": s, "load": q, "y": p * (1 - 3 * s) + q}


def test_ranges_are_interpolated_between_levels():
    found = list(limits(LEVELS, "pressure"))
    assert [(one.name, one.at) for one in found] == [
        ("pressure", None), ("strain", "pressure"), ("load", "pressure")
    ]  # fmt: skip
    at = {"pressure": np.array([50.0, 100.0, 150.0, 300.0, 400.0])}
    low, high = found[1].ends(at)
    np.testing.assert_allclose(low, [0, 0, 0.005, 0.02, 0.02])
    np.testing.assert_allclose(high, [0.1, 0.1, 0.15, 0.3, 0.3])
    assert [ends.tolist() for ends in found[0].ends(at)] == [[100.0], [300.0]]
    assert list(limits([], "pressure")) == []
    edge = {"pressure": np.full(4, 200.0), "strain": np.array([0.01, 0.2, 0.01, 0.2])}
    edge["strain"] += np.array([-1, 1, -1, 1]) * np.array([1e-10, 1e-10, 1e-9, 1e-9])
    assert outside_limits(LEVELS, "pressure", edge).tolist() == [False, False, True, True]
    far = {"pressure": np.array([99.0, 301.0, 300.0]), "strain": np.full(3, 0.05)}
    assert outside_limits(LEVELS, "pressure", far).tolist() == [True, True, False]
    unit = [CurveRange("c", None, {"x": (0.0, 1.0)})]
    ends = np.array([-1e-9, 1 + 1e-9])  # exactly the tolerance
    assert outside_limits(unit, None, {"x": ends}).tolist() == [False, False]
    width = [CurveRange("c", None, {"x": (-1.0, 1.0)})]  # twice as large as both ends
    beyond = 1 + np.array([1.9e-9, 2.1e-9])
    for x in (beyond, -beyond):
        assert outside_limits(width, None, {"x": x}).tolist() == [False, True]
    load = {"pressure": np.array([200.0, 200.0]), "load": np.array([5.0, 5.1])}
    assert outside_limits(LEVELS, "pressure", load).tolist() == [False, True]


def test_a_shape_is_required_within_the_ranges_and_above_the_slack_part():
    """By a tenth of the range beyond, and above a fifth of the output's range."""
    fit = Fit(shape={"strain": "decreasing"}, slack=0.2, beyond=0.1)
    region = region_of(by_levels(), fit, LEVELS, "pressure")
    assert region.ends == {
        "pressure": pytest.approx((80.0, 320.0)),
        "strain": pytest.approx((-0.028, 0.328)),
        "load": pytest.approx((0.4, 7.6)),
    }
    rng = np.random.default_rng(6)
    at = {"pressure": rng.uniform(70, 330, 600), "strain": rng.uniform(-0.05, 0.35, 600)}
    at["load"] = rng.uniform(0, 8, 600)
    p = np.clip(at["pressure"], 100, 300)
    share = (p - 100) / 200
    expected = region.output(at) > region.values.min() + 0.2 * np.ptp(region.values)
    ends = {"pressure": (100.0, 300.0), "strain": (0.02 * share, 0.1 + 0.2 * share)}
    for name, (low, high) in (ends | {"load": (1.0, 3 + 4 * share)}).items():
        beyond = 0.1 * (high - low)
        expected &= (at[name] >= low - beyond) & (at[name] <= high + beyond)
    assert region.holds(at).tolist() == expected.tolist()
    assert 50 < expected.sum() < 500
    at_end = {name: np.array([value]) for name, value in
              {"pressure": 320.0, "strain": 0.02, "load": 0.4}.items()}  # fmt: skip
    assert region.holds(at_end).all()


def test_a_grid_has_even_lines_lines_beside_knots_and_a_line_at_zero():
    region = region_of(by_levels(), None, LEVELS, "pressure")
    axes = region.axes({"strain": (0.1, 0.5), "pressure": ()}, 1000)
    near = 1e-6 * 0.3
    expected = {*np.linspace(0, 0.3, 10).tolist(), 0.1 - near, 0.1, 0.1 + near, 0.0}
    assert axes["strain"].tolist() == pytest.approx(sorted(expected))
    assert axes["pressure"].tolist() == np.linspace(100, 300, 10).tolist()
    assert [region.nodes_along(count) for count in (8, 27, 1000, 10**9)] == [3, 3, 10, 400]
    moves = {"rate": np.linspace(-1, 3, 50), "still": np.full(50, 2.0)}
    moving = region_of(moves | {"y": np.linspace(0, 1, 50)})
    assert moving.axes({}, 3)["rate"].tolist() == [-1.0, 0.0, 1.0, 3.0]
    assert moving.axes({}, 3)["still"].tolist() == [2.0]
    words = [
        ShapeWord("still", "increasing"),
        ShapeWord("rate", "convex"),
        ShapeWord("y", "positive"),
    ]
    assert moving.asks(words) == words[1:]


def by_word(word, y, x):
    """What must not be negative, of values y at places x, (m, points) each."""
    sign = -1 if word in ("decreasing", "concave") else 1
    if word == "positive":
        return y[:, 0]
    if POINTS[word] == 3:
        share = (x[:, 1] - x[:, 0]) / (x[:, 2] - x[:, 0])
        return sign * ((1 - share) * y[:, 0] + share * y[:, 2] - y[:, 1])
    low, high = np.split(y, 2, axis=1)
    return sign * (high.mean(axis=1) - low.mean(axis=1))


PAIRS = [word for word, points in POINTS.items() if points == 2]


@pytest.mark.parametrize(
    ("word", "reach"), [*((word, 1) for word in POINTS), *product(PAIRS, (2, 4))]
)
@pytest.mark.parametrize("quantity", ["a", "b"])
def test_stencils_compare_neighbours_along_one_quantity(word, reach, quantity):
    """Means of `reach` neighbours; the next begins half of that farther; all lie inside."""
    rng = np.random.default_rng(reach)
    axes = {"a": np.cumsum(rng.random(9)), "b": np.cumsum(rng.random(10)), "still": np.ones(1)}
    columns = nodes_of(axes)
    inside, values = rng.random(90) < 0.95, rng.normal(size=90)
    of = "force" if word == "positive" else quantity
    found = stencils_on(axes, ShapeWord(of, word), inside, reach)
    points = POINTS[word] * reach
    table = np.arange(90).reshape(9, 10)
    lines = (table.T if quantity == "a" or points == 1 else table).tolist()
    groups = [
        (line[start : start + points], line[0])
        for line in lines
        for start in range(0, len(line) - points + 1, max(reach // 2, 1))
        if inside[line[start : start + points]].all()
    ]
    assert sorted(zip(found.nodes.tolist(), found.lines.tolist(), strict=True)) == sorted(groups)
    x = columns[quantity][found.nodes]
    np.testing.assert_allclose(stencil_weights(word, x), found.weights)
    expected = by_word(word, values[found.nodes], x)
    np.testing.assert_allclose(found.of(values), expected, atol=1e-12)
    both = found.of(np.column_stack([values, 2 * values]))
    np.testing.assert_allclose(both.T, [expected, 2 * expected], atol=1e-12)
    some, used = found.at(np.array([2, 0])), np.unique(found.nodes[[2, 0]])
    for name, column in columns.items():
        assert some.columns[name].tolist() == column[used].tolist()
    np.testing.assert_allclose(some.of(values[used]), expected[[2, 0]], atol=1e-12)
    places = ", ".join(f"{n} = {x[found.nodes[0]].mean():.4g}" for n, x in columns.items())
    assert found.told == f"{of}: {word} at {places}"


def test_each_word_of_each_quantity_is_asked():
    fit = Fit(shape={"a": "increasing", "b": ["decreasing", "convex"]})
    assert [(one.quantity, one.word) for one in asked_of(fit)] == [
        ("a", "increasing"), ("b", "decreasing"), ("b", "convex")
    ]  # fmt: skip
    assert asked_of(Fit()) == []


@pytest.mark.parametrize(("count", "most"), [(1, 1000), (2, 64), (3, 24)])
def test_a_grid_has_about_4096_nodes_but_not_too_few_or_many_along_one_input(count, most):
    """Along an input that takes few values, these are its places."""
    places = np.random.default_rng(0).random((5000, count + 1))
    places[:, -1] = np.arange(5000) % 7
    names = [*"abcd"[:count], "few"]
    of_all = SimpleNamespace(names=names[:-1], places=places[:, :-1], fixed={"g": np.ones(1)})
    axes = _axes(of_all, None)
    assert [len(axes[name]) for name in ("g", *names[:-1])] == [1, *(count * [most])]
    assert axes["a"][[0, -1]].tolist() == [places[:, 0].min(), places[:, 0].max()]
    assert np.ptp(np.diff(axes["a"])) < 1e-12
    exact = SimpleNamespace(names=names[:-1], places=places[:most, :-1], fixed={})
    assert _axes(exact, None)["a"].tolist() == sorted(places[:most, 0])
    with_few = SimpleNamespace(names=names, places=places, fixed={})
    assert _axes(with_few, None)["few"].tolist() == [*range(7)]


@pytest.mark.parametrize("word", PAIRS)
@pytest.mark.parametrize(("errors", "confirmed"), [(-5, False), (2.9, False), (3.1, True)])
def test_a_slope_of_more_than_three_standard_errors_confirms_a_contradiction(
    word, errors, confirmed
):
    """The residuals are normal to the line, which has twelve degrees of freedom."""
    x = np.linspace(-1, 1, 14)
    line = np.column_stack([np.ones(14), x])
    left = np.random.default_rng(0).normal(size=14)
    left -= line @ np.linalg.lstsq(line, left)[0]
    error = np.sqrt(left @ left / 12 / (x @ x))
    wrong = -1 if word == "increasing" else 1
    cells = SimpleNamespace(
        names=("x",), places=x[:, None], values=wrong * errors * error * x + left
    )
    assert _confirmed(cells, ShapeWord("x", word), np.arange(14)) == confirmed
    two = SimpleNamespace(names=("x",), places=x[:2, None], values=wrong * x[:2])
    assert _confirmed(two, ShapeWord("x", word), np.arange(2))  # no freedom, hence no error


@pytest.mark.parametrize(("cells", "inputs", "near"), [(30, 1, 12), (30, 5, 13), (4, 1, 4)])
def test_the_cells_near_a_cell_are_twelve_or_more_than_twice_the_inputs(cells, inputs, near):
    places = np.random.default_rng(0).random((cells, inputs))
    found = _near(SimpleNamespace(places=places))
    assert found.shape == (cells, near)
    assert found[:, 0].tolist() == [*range(cells)]


@pytest.mark.parametrize(("cells", "known"), [(3, False), (4, True)])
def test_noise_is_known_from_three_cells_around_a_cell(cells, known):
    few = SimpleNamespace(
        places=np.arange(cells)[:, None] * 1.0,
        values=np.arange(cells) % 2 * 1.0,
        counts=np.ones(cells),
    )
    assert (_noise(few, _near(few)) > 0).tolist() == [known] * cells


def test_a_region_is_widened_by_the_direct_neighbours_of_its_nodes():
    axes = {"a": np.arange(6.0), "b": np.arange(7.0)}
    at = nodes_of(axes)
    found = _widened(axes, (at["a"] == 2) & (at["b"] == 3))
    assert found.tolist() == ((abs(at["a"] - 2) <= 1) & (abs(at["b"] - 3) <= 1)).tolist()


def test_a_finer_grid_reaches_from_the_middle_of_a_stencil_to_the_next_nodes():
    """By nine nodes along each input, but not beyond the ends of the region."""
    region = region_of(by_levels(), None, LEVELS, "pressure")
    axes = {"pressure": np.linspace(100, 300, 5), "strain": np.linspace(0, 0.3, 4),
            "load": np.linspace(1, 7, 3)}  # fmt: skip
    coarse = stencils_on(axes, ShapeWord("pressure", "increasing"), np.ones(60, dtype=bool))
    first = coarse.at(np.array([0]))
    steps = {"pressure": 50.0, "strain": 0.1, "load": 3.0}
    found = _grid_about(first, steps, region)
    assert np.unique(found.columns["pressure"]) == pytest.approx([*np.linspace(100, 175, 7)])
    assert np.unique(found.columns["strain"]) == pytest.approx([0, 0.025, 0.05, 0.075, 0.1])
    assert found.asked == first.asked
