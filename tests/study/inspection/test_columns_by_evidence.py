"""Columns without titles, in any order, with sensors' volts, counts and clocks beside them: never a
wrong one that looks sure.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mapmore_cli.annexes.drafting.answers import Answers, read_columns
from mapmore_cli.annexes.drafting.columns import Table, guess_columns, guess_others
from mapmore_cli.annexes.drafting.draft import Guess
from mapmore_cli.checking.evidence import leads, same_signals, untold
from mapmore_cli.domain.errors import UsageError

LEVELS = (1.0, 2.0, 3.0, 4.0)  # bar
TIME = np.arange(400) * 0.01


def strokes(level: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """A cylinder that is pushed in and out: its pressure, a load cell that lies between 1 and 8 as
    well, and the volts of both.
    """
    swing = 20 * (1 - np.cos(2 * np.pi * TIME))
    pressure = level + rng.normal(0, 0.005, TIME.size)
    force = (
        47 * level * 1.05 + 6 * np.sign(np.sin(2 * np.pi * TIME)) + rng.normal(0, 0.3, TIME.size)
    )
    position = swing + rng.normal(0, 0.05, TIME.size)
    volts = {
        "pressure volts": pressure / 2,
        "force volts": force / 46.5,
        "position volts": 3.2 + position / 12,
    }
    return {"time": TIME, "pressure": pressure, "force": force, "position": position, **volts}


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(order=st.permutations(range(7)), seed=st.integers(0, 99))
def test_volts_beside_each_sensor_are_never_taken_for_the_pressure(
    order: list[int], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    records = [strokes(level, rng) for level in LEVELS]
    names = list(records[0])
    raw = {place: [record[names[which]] for record in records] for place, which in enumerate(order)}
    guesses = guess_columns(Table({}, raw), told=LEVELS)
    found = {name: names[order[guess.column]] for name, guess in guesses.items()}
    assert found["time"] == "time"
    assert found["pressure"] == "pressure"
    assert (
        found["force"].partition(" ")[0] != found["displacement"].partition(" ")[0]
    )  # two signals, and neither the pressure
    assert not {"pressure", "pressure volts"} & {found["force"], found["displacement"]}
    assert not any(guess.sure for guess in guesses.values())
    assert any(
        rival.column == order.index(names.index("pressure volts"))
        for rival in guesses["pressure"].rivals
    )


RNG = np.random.default_rng(0)
RISING = 300 * (1 - np.cos(TIME))
NOISY = RISING + RNG.normal(0, 1, TIME.size)
COUNTS = np.round(np.clip(1.1 * NOISY - 60 + RNG.normal(0, 8, TIME.size), 0, None))
FORCE = 0.7 * RISING - 9 + RNG.normal(0, 6, TIME.size)
STATE = np.where(TIME < 2, 1.0, 2.0)  # of a valve
RAMP = np.linspace(0, 0.2, 3)


@pytest.mark.parametrize(
    ("columns", "found", "counts"),
    [
        ([COUNTS, np.abs(NOISY), TIME], {"force": 0, "pressure": 1, "time": 2}, True),
        ([FORCE, RISING, TIME, STATE, 1.7e9 + TIME], {"force": 0, "pressure": 1, "time": 2}, False),
        ([RAMP, np.zeros(3), RAMP, 200 - 600 * RAMP], {"time": 0, "pressure": 1, "force": 3}, True),
        ([np.arange(30.0), np.arange(30.0) ** 2], {}, False),
    ],
)
def test_columns_without_titles_are_told_by_their_values(
    columns: list[np.ndarray], found: dict[str, int], counts: bool
) -> None:
    guesses = guess_columns(Table({}, {place: [values] for place, values in enumerate(columns)}))
    assert {name: guess.column for name, guess in guesses.items()} == found
    assert not any(guess.sure for guess in guesses.values())
    assert ("counts" in str(guesses.get("force"))) == counts


def test_both_chambers_at_an_atmosphere_drive_in_mbar() -> None:
    rng = np.random.default_rng(1)
    one, two = (1012 + 600 * np.clip(np.sin(3 * TIME + shift), 0, None) for shift in (0.0, 3.2))
    angle = 0.05 * (one - two) + rng.normal(0, 0.3, TIME.size)
    still = [
        1011 + rng.normal(0, 0.05, TIME.size),
        64 + rng.normal(0, 0.1, TIME.size),
        np.round(7 * rng.random(TIME.size)),
    ]
    table = Table(
        {},
        dict(
            enumerate(
                [[column] for column in (TIME, one, still[0], two, still[1], angle, still[2])]
            )
        ),
    )
    found = guess_others(table, guess_columns(table))
    guesses, inputs, target = found
    assert [(guesses[name].column, guesses[name].unit) for name in inputs] == [
        (1, "mbar"),
        (3, "mbar"),
    ]
    assert guesses[target].column == 5


def test_all_named_pressures_drive_and_no_clock_follows() -> None:
    p1, p2 = 200 + 50 * np.sin(TIME), 200 + 40 * np.sin(1.7 * TIME + 1)
    angle = 0.2 * (p1 - p2)
    columns = {"t": [TIME], "p1_kPa": [p1], "p2_kPa": [p2], "q": [angle], "tout": [TIME + 3]}
    table = Table({name: name for name in columns}, columns)
    found = guess_others(table, guess_columns(table))
    assert (len(found[1]), found[2]) == (2, "q")


def test_what_comes_later_was_measured_and_what_comes_first_commanded() -> None:
    command = 100 + 50 * np.sin(3 * TIME) + 20 * np.sin(7.1 * TIME)
    assert leads(command, np.roll(command, 9))
    assert not leads(np.roll(command, 9), command)
    assert not leads(command, np.sin(40 * TIME))


def test_one_signal_in_two_units_is_found_and_a_loop_is_none() -> None:
    one = np.sin(TIME)
    assert same_signals([one, np.cos(TIME), 7 - 3 * one]) == [[0, 2]]
    assert same_signals([one, one + 0.1 * np.cos(TIME)]) == []
    assert same_signals([np.ones(400), np.ones(400)]) == []


def test_a_response_is_told_by_its_drives_and_noise_is_not() -> None:
    drive = np.sin(TIME * 9) + np.sin(TIME * 4)
    assert untold([[drive]], [3 * drive**2]) < 0.05
    assert untold([[drive]], [np.random.default_rng(0).normal(size=TIME.size)]) > 0.9


def test_columns_are_said_by_place_or_by_title() -> None:
    told = read_columns("time:ms,_,force=Load Cell:N*1.744-18.6,pressure:mbar-1013")
    assert told == {
        "time": Guess(0, "ms"),
        "force": Guess("Load Cell", "N", scale=1.744, offset=-18.6),
        "pressure": Guess(3, "mbar", offset=-1013.0),
    }
    assert Answers(told).for_columns(("a", "b", "c"), 3) is None


@pytest.mark.parametrize(
    "text",
    [
        "",
        "time:s",
        "a b:s,force:N",
        "force:kPa,pressure:bar",
        "force:N,force:N,time:s",
        "x:parrots,y",
    ],
)
def test_columns_that_cannot_be_are_refused(text: str) -> None:
    with pytest.raises(UsageError):
        read_columns(text)
