"""Lookup tables: regular grids over the inputs."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.study.prediction.grid import grid_lines

INPUTS = ("pressure", "strain")


def points(text: str, inputs: tuple[str, ...] = INPUTS) -> list[tuple[float, ...]]:
    return [tuple(map(float, line.split(","))) for line in list(grid_lines(text, inputs))[1:]]


@settings(deadline=None)
@given(st.integers(-1000, 1000), st.integers(0, 60), st.sampled_from([1e-3, 0.01, 0.05, 0.1, 0.3, 1.0, 2.5, 25.0, -0.01, -25.0]))
def test_points_are_evenly_spaced_from_end_to_end(start: int, steps: int, step: float) -> None:
    first, last = start / 10, start / 10 + steps * step
    axis = [x for (x,) in points(f"x={first!r}:{last!r}:{step!r}", ("x",))]
    assert len(axis) == steps + 1
    assert axis == pytest.approx([first + i * step for i in range(steps + 1)], abs=1e-9)
    assert (axis[0], axis[-1]) == pytest.approx((first, last), rel=1e-11, abs=1e-11)


def test_the_last_one_named_varies_fastest() -> None:
    assert points("strain=0:0.1:0.1,pressure=10:20:5") == [(0, 10), (0, 15), (0, 20), (0.1, 10), (0.1, 15), (0.1, 20)]


def test_numbers_are_printed_as_a_person_would() -> None:
    assert [line.strip() for line in grid_lines("x=0:0.3:0.1", ("x",))] == ["x", "0", "0.1", "0.2", "0.3"]


def test_one_value_holds_an_input() -> None:
    assert points("pressure=150,strain=0:0.2:0.1") == [(150, 0), (150, 0.1), (150, 0.2)]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "has no '='"),
        ("pressure", "has no '='"),
        ("pressure=0:1", "cannot read 'pressure=0:1'"),
        ("pressure=a:b:c", "cannot read"),
        ("pressure=0:inf:1", "cannot read"),
        ("pressure=nan", "cannot read"),
        ("pressure=0:1:0", "does not lead from 0 to 1"),
        ("pressure=1:0:0.1", "does not lead from 1 to 0"),
        ("pressure=0:1:1e-9", "at most 10000000 steps"),
        ("pressure=0:1:1e-4,strain=0:1:1e-4", "asks for 100020001 points, more than 10000000"),
        ("pressure=0:1:0.3,strain=0", "not a whole number of steps"),
        ("pressure=0,pressure=1,strain=0", "'pressure' is given twice"),
        ("pressure=0:1:1", "no values for strain"),
        ("pressure=0,strian=0", "did you mean 'strain'?"),
        ("pressure=0,strain=0,", "has no '='"),
    ],
)
def test_what_is_refused_before_anything_is_computed(text: str, what: str) -> None:
    with pytest.raises(UsageError) as caught:
        grid_lines(text, INPUTS)
    assert what in str(caught.value)
