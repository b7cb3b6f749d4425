"""Lookup tables: regular grids over the inputs; files for other programs."""

from pathlib import Path

import pytest
from cli_samples import csv_rows, write_lines
from common import rows_of
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.pipeline.records import grid_lines

INPUTS = ("pressure", "strain")


def points(text, inputs=INPUTS):
    return [tuple(map(float, line.split(","))) for line in list(grid_lines(text, inputs))[1:]]


@given(
    st.integers(-1000, 1000),
    st.integers(0, 60),
    st.sampled_from([1e-3, 0.01, 0.05, 0.1, 0.3, 1.0, 2.5, 25.0, -0.01, -25.0]),
)
def test_points_are_evenly_spaced_from_end_to_end(start, steps, step):
    first, last = start / 10, start / 10 + steps * step
    axis = [x for (x,) in points(f"x={first!r}:{last!r}:{step!r}", ("x",))]
    assert len(axis) == steps + 1
    assert axis == pytest.approx([first + i * step for i in range(steps + 1)], abs=1e-9)
    assert (axis[0], axis[-1]) == pytest.approx((first, last), rel=1e-11, abs=1e-11)


def test_the_last_one_named_varies_fastest_and_one_value_holds_an_input():
    assert points("strain=0:0.1:0.1,pressure=10:20:5") == [
        (0, 10),
        (0, 15),
        (0, 20),
        (0.1, 10),
        (0.1, 15),
        (0.1, 20),
    ]
    assert points("x=0:1:0.33333334,y=3:3:1", ("x", "y"))[-1] == (1, 3)
    assert points("pressure=150,strain=0:0.2:0.1") == [(150, 0), (150, 0.1), (150, 0.2)]
    # as a person would print them
    assert [line.strip() for line in grid_lines("x=0:0.3:0.1", ("x",))] == [
        "x",
        "0",
        "0.1",
        "0.2",
        "0.3",
    ]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        *rows_of("""
pressure                           has no '='
pressure=0:1                       cannot read 'pressure=0:1'
pressure=a:b:c                     cannot read
pressure=0:inf:1                   cannot read
pressure=nan                       cannot read
pressure=0:1:0                     the step must not be zero
pressure=1:0:0.1                   a step of 0.1 never leads from 1 to 0
pressure=0:1:1e-9                  has 1e+09 steps; at most 10000000 are
pressure=0:1:1e-4,strain=0:1:1e-4  has 100020001 points; at most 10000000
pressure=0:1:0.3,strain=0          not a whole number of steps
pressure=0:1:0.4,strain=0          not a whole number of steps
pressure=0:1:0.333333,strain=0     not a whole number of steps
pressure=0,pressure=1,strain=0     'pressure' is given twice
pressure=0:1:1                     no values for strain
pressure=0,strian=0                did you mean 'strain'?
pressure=0,strain=0,               has no '='
"""),
        ("", "has no '='"),
    ],
)
def test_what_is_refused_before_anything_is_computed(text, what):
    with pytest.raises(UsageError) as caught:
        grid_lines(text, INPUTS)
    assert what in str(caught.value)


def test_invert_finds_what_predict_gave(mapmore, model_file):
    at, wanted = Path("at.csv"), Path("wanted.csv")
    write_lines(at, "pressure,strain", "120,0.05", "180,0.1")
    rows = csv_rows(mapmore("predict", model_file, at, "--derivatives", code=0).stdout)
    ends = ["force_predicted", "outside_range", "force_by_pressure", "force_by_strain"]
    assert [*rows[0]] == ["pressure", "strain", *ends]
    forces = [f"{row['force_predicted']},{row['strain']}" for row in rows]
    write_lines(wanted, "force,strain", *forces, "1e12,0.1", ",0.1")
    found = mapmore("invert", model_file, wanted, "--for", "pressure", code=0).stdout
    answers = [[*answer.values()] for answer in csv_rows(found)]
    for row, answer in zip(rows, answers, strict=False):
        solutions = [float(one) for one in answer[3].split()]
        assert min(abs(one - float(row["pressure"])) for one in solutions) < 1e-5
    assert [answer[2:] for answer in answers[2:]] == [["", "", "none"], ["", "", ""]]
    assert found.startswith("force,strain,pressure_found,pressure_solutions,pressure_status\n")
