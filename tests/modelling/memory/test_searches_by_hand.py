"""Rules of the search of parameters and free runs, on problems of which the end is known."""

from dataclasses import replace

import numpy as np
import pytest
from memory_samples import record

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import parse, to_text
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import state
from mapmore_cli.modelling.memory.feedback import looks_back, parted, parts_of_terms
from mapmore_cli.modelling.memory.free_parameters import Unknown, left_open
from mapmore_cli.modelling.memory.refinement import (
    THOROUGH,
    FreeRunProblem,
    Point,
    free_run_errors,
    minimise,
    refine,
)


class Line(FreeRunProblem):
    """`y = a x + c` on four samples; a run over more than `bearable` samples diverges."""

    X, Y = np.array([0.0, 1.0, 2.0, 4.0]), np.array([1.0, 3.0, 5.0, 9.0])
    PHI = np.column_stack([X, np.ones(4)])
    bearable, asked = np.inf, []

    def at(self, vector, horizon=None):
        self.asked.append(horizon)
        vector = np.clip(vector, *self.between)
        if (horizon or max(map(len, self.counted))) > self.bearable:
            return Point(vector)
        theta, constant, _ = self.split(vector)
        left = (self.Y - theta[0] * self.X - constant)[: len(self.counted[0])]
        return Point(vector, float(left @ left + self.ridge @ theta**2), (), left)

    def slopes(self, _point, _horizon=None):
        return self.PHI[: len(self.counted[0])]


def line(ridge=0.0, constant=True, low=-np.inf, high=np.inf, counted=(4,), fed_back=False):
    class Piece:
        class feedback:  # noqa: N801
            weights = ("weight_0",) if fed_back else ()

    between = np.array([[low, -np.inf], [high, np.inf]])
    problem = Line(
        lambda _: [Piece for _ in counted],
        [np.ones(count, dtype=bool) for count in counted],
        (0, 0),
        np.array([ridge]),
        constant,
        between,
    )
    problem.asked.clear()
    return problem


@pytest.mark.parametrize("ridge", [0.0, 3.0])
def test_the_least_error_is_that_of_the_normal_equations(ridge):
    found = minimise(line(ridge), np.array([10.0, -7.0]), None, THOROUGH)
    P = Line.PHI
    expected = np.linalg.solve(P.T @ P + np.diag([ridge, 0.0]), P.T @ Line.Y)
    np.testing.assert_allclose(found.vector, expected, rtol=1e-5)
    if not ridge:
        np.testing.assert_allclose(found.vector, [2, 1], rtol=1e-5)
        assert found.error == pytest.approx(0, abs=1e-8)


@pytest.mark.parametrize("n", [2, 3])
def test_errors_need_more_samples_than_free_coefficients(n):
    errors, worth = free_run_errors(line(counted=(n,)), np.array([2.5, 1.0]))
    assert np.isfinite([*errors, worth]).tolist() == [n > 2] * 3


def test_bounds_hold_and_a_constant_may_be_none():
    assert minimise(line(high=1.5), np.array([0.0, 0.0]), None, THOROUGH).vector[0] == 1.5
    assert minimise(line(low=2.5), np.array([3.0, 0.0]), None, THOROUGH).vector[0] == 2.5
    held = minimise(line(constant=False), np.array([0.0, 0.5]), None, THOROUGH).vector
    assert held[1] == 0.5
    assert held[0] == pytest.approx(Line.X @ (Line.Y - 0.5) / (Line.X @ Line.X))
    problem = line(low=0.0, high=1.0)
    for at, downhill, free in (
        (0, -1, 0),
        (0, 1, 1),
        (1, 1, 0),
        (1, -1, 1),
        (0.5, 1, 1),
        (0, 0, 1),
        (1, 0, 1),
    ):
        assert problem.free(np.array([at, 0.0]), np.array([downhill, 0.0])).tolist() == [free, 1]


def test_a_step_that_does_not_lower_the_error_is_not_taken(monkeypatch):
    monkeypatch.setattr(Line, "at", lambda self, vector, _=None: Point(vector, 1.0, (), self.Y))
    assert minimise(line(), np.array([10.0, -7.0]), None, THOROUGH).vector.tolist() == [10, -7]


def test_horizons_grow_eightfold_from_sixteen_and_shrink_where_runs_diverge():
    for counted in ((2000,), (90, 2000)):  # the longest record counts
        problem = line(counted=counted, fed_back=True)
        assert np.isfinite(refine(problem, np.zeros(2)).error)
        assert [*dict.fromkeys(problem.asked)] == [16, 128, 1024, None]
    problem = line(counted=(2000,))
    refine(problem, np.zeros(2))
    assert {*problem.asked} == {None}
    for bearable, horizons in (
        (15, [16]),
        # the geometric mean of 16 and 128 is 45, of 45 and 16 is 26, and 20 is the last worth it
        (17, [16, 128, 45, 26, 20]),
        (50, [16, 128, 45, 360, 127, 75, 58]),
    ):
        problem = line(counted=(2000,), fed_back=True)
        object.__setattr__(problem, "bearable", bearable)
        assert refine(problem, np.zeros(2)).error == np.inf
        assert [*dict.fromkeys(problem.asked)] == horizons


@pytest.mark.parametrize(
    ("term", "fed", "inputs"),
    [
        *(("x", "1", "x"), ("y1", "y1", "1"), ("x*y1*y2", "y1*y2", "x"), ("1", "1", "1")),
        *(("x^2*exp(y1)", "exp(y1)", "x^2"), ("2*x*y1", "y1", "2*x")),
    ],
)
def test_terms_are_parted_into_what_is_fed_back_and_inputs(term, fed, inputs):
    own, other = parted(parse(term), {"y1", "y2"})
    assert (own, other) == (parse(fed), parse(inputs))


def test_mixed_factors_cannot_be_parted():
    with pytest.raises(DataError, match="mixes delayed outputs and inputs"):
        parted(parse("exp(x*y1)"), {"y1"})
    parts = parts_of_terms(["x", "y1", "x*y2", "z*y1"], {"y1", "y2"})
    assert parts.groups.tolist() == [-1, 0, 1, 0]
    assert [*map(to_text, parts.inputs)] == ["x", "1", "x", "z"]
    assert [*map(to_text, parts.owns)] == ["y1", "y2"]


@pytest.mark.parametrize(
    ("name", "back"),
    [
        *(("y[k-1]", True), ("y", False), ("dahl(y[k-1], 2)", True), ("dahl(y, 2)", False)),
        ("dahl(y, 2)[k-1]", False),
    ],
)
def test_which_states_look_back(name, back):
    assert looks_back(state(name)) is back


def test_what_the_terms_leave_open_is_searched_up_to_the_longest_record():
    """Of its training samples; a state comes after those from which it is computed."""
    records = [record(np.arange(12) < n, x=np.zeros(12)) for n in (4, 9, 7)]
    terms = ["slow(wen(x))*slow(y[k-1], 2)", "wen(x)*play(x, 0.1)", "x^2"]
    found = left_open(records, terms, 0.5)
    assert found.states == (state("wen(x)"), state("slow(wen(x))"))
    assert (found.step, found.longest, left_open([], terms, 0.5).longest) == (0.5, 4.5, 0.5)


UNKNOWN = Unknown((state("wen(x)"), state("slow(y[k-1])")), 0.1, 50.0)


def test_positive_parameters_are_searched_by_their_logarithm():
    low, high = UNKNOWN.limits
    assert len(UNKNOWN.places) == len(low) == 3
    middle = (low + high) / 2
    np.testing.assert_allclose(
        UNKNOWN.searched(middle), np.where(low > 0, np.log(np.abs(middle)), middle)
    )
    np.testing.assert_allclose(UNKNOWN.numbers(UNKNOWN.searched(middle)), middle)
    np.testing.assert_allclose(UNKNOWN.searched(low - 1), UNKNOWN.bounds[0])
    np.testing.assert_allclose(UNKNOWN.searched(high + 1), UNKNOWN.bounds[1])
    assert UNKNOWN.numbers(UNKNOWN.searched(middle), 2) == tuple(float(f"{x:.2g}") for x in middle)
    assert UNKNOWN.those_of(Unknown((state("wen(x)"),), 0.1, 50.0)).tolist() == [1, 1, 0]
    texts = UNKNOWN.filled(["u*wen(x)", "slow(y[k-1])^2"], (1.0, 2.0, 3.0))
    assert [parse(text) for text in texts] == [parse("u*wen(x, 1, 2)"), parse("slow(y[k-1], 3)^2")]


def test_errors_of_parameters_are_in_their_own_unit_and_unknown_at_a_bound():
    low, high = UNKNOWN.bounds
    middle, errors = (low + high) / 2, np.array([0.1, 0.2, 0.3])
    found = UNKNOWN.identified(middle, errors)
    numbers = np.array(UNKNOWN.numbers(middle))
    scale = np.where(UNKNOWN.limits[0] > 0, numbers, 1)
    np.testing.assert_allclose(found.numbers, numbers, rtol=1e-9)
    np.testing.assert_allclose(found.errors, errors * scale, rtol=1e-9)
    reach = 1e-6 * (high - low)
    for share, held in ((0.9, True), (1.0, True), (1.1, False)):
        for near in (low + share * reach, high - share * reach):
            assert np.isnan(UNKNOWN.identified(near, errors).errors).tolist() == [held] * 3
    np.testing.assert_allclose(UNKNOWN.begun_at(None), middle, atol=1e-14)
    known = replace(found, names=found.names[:1], numbers=numbers[:1] * 1.5)
    begun = UNKNOWN.begun_at(known)
    np.testing.assert_allclose(begun[1:], middle[1:])
    np.testing.assert_allclose(begun[:1], UNKNOWN.searched(numbers * 1.5)[:1])


def test_starting_values_are_all_tried_if_there_are_few():
    tried = []

    def error(numbers):
        tried.append(numbers)
        return sum((x - 7) ** 2 for x in numbers)

    one = replace(UNKNOWN, states=UNKNOWN.states[1:])
    grid = OPERATORS["slow"].starts(0.1, 50.0)
    assert one.scan(error, 2) == sorted((tuple(x) for x in grid), key=lambda x: (x[0] - 7) ** 2)[:2]
    assert len(tried) == len(grid)
    for states, count in (
        (("creep(x)", "creep(z)"), 64),
        (("wen(x)", "play(z)"), 16 + 5),  # not 80
    ):
        tried.clear()
        best = replace(UNKNOWN, states=tuple(map(state, states))).scan(error, 1)
        assert len(tried) == count
        assert error(best[0]) == min(map(error, tried[:]))
