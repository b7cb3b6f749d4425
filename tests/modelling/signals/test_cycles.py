"""Cycles: their branches, and where strokes begin."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.cycles import (
    _trimmed_runs,
    cycle_starts,
    split_cycles,
)

REACH = 0.2


def static(strain):
    return 500 * (1 - strain / REACH) ** 2 + 40 * strain


def half_width(strain):
    return 8 + 60 * strain


def loop(per_branch, cycles=1, warp=1.0, rest=0, start=0.0):
    """Strain and force of load cycles run at uneven speed (`warp`), with rests in which force
    creeps between the branches.
    """
    rise = REACH * np.linspace(0, 1, per_branch) ** warp
    strain, sign = [], []
    for branch in range(2 * cycles):
        path = rise if branch % 2 == 0 else rise[::-1]
        strain += [path, np.full(rest, path[-1])]
        sign += [
            np.full(per_branch, -1.0 if branch % 2 == 0 else 1.0),
            np.linspace(-1, 1, rest) * (1 if branch % 2 == 0 else -1),
        ]
    over, side = np.concatenate(strain), np.concatenate(sign)
    begin = int(np.searchsorted(rise, start))
    return over[begin:], (static(over) + side * half_width(over))[begin:]


@given(
    per_branch=st.integers(300, 2000),
    cycles=st.integers(1, 3),
    warp=st.floats(0.6, 1.7),
    rest=st.integers(0, 300),
    start=st.floats(0, 0.1),
    samples=st.integers(50, 200),
)
def test_known_components_are_recovered_at_any_speed(
    per_branch, cycles, warp, rest, start, samples
):
    over, force = loop(per_branch, cycles, warp, rest, start if cycles > 1 else 0.0)
    branches = split_cycles(over, {"force": force, "pressure": np.full(len(over), 150.0)}, samples)
    x = branches.over
    assert len(x) == samples
    np.testing.assert_allclose(np.diff(x), x[1] - x[0], rtol=1e-6)
    assert x[0] < 0.03 * REACH
    assert x[-1] > 0.97 * REACH
    bend = 25_000 / 3 * max(REACH / samples, np.diff(np.sort(over)).max()) ** 2
    np.testing.assert_allclose(branches.static()["force"], static(x), atol=0.01 + bend)
    np.testing.assert_allclose(branches.hysteresis("force"), half_width(x), atol=0.01 + bend)
    np.testing.assert_allclose(branches.static()["pressure"], 150.0)
    np.testing.assert_allclose(
        branches.static()["force"] + branches.hysteresis("force"), branches.extension["force"]
    )


@pytest.mark.parametrize("ripple", [1.0, 3.0])
def test_rests_end_where_the_noise_is_left(ripple):
    """Noise of +-a bends by 4 a, so its standard deviation is told as 1.4826 4 a/sqrt(6); twice
    that is trimmed, but no more than a hundredth of the range.
    """
    over = np.concatenate([np.zeros(60), np.arange(0.5, 1000, 0.5), np.full(60, 999.5)])
    over += ripple * np.where(np.arange(len(over)) % 2, -1, 1)
    (rows,) = _trimmed_runs(over)[1]
    trimmed = min(2 * 1.4826 * 4 * ripple / 6**0.5, np.ptp(over) / 100)
    assert rows[0] == np.flatnonzero(over <= over.min() + trimmed)[-1]
    assert rows[-1] == np.flatnonzero(over >= over.max() - trimmed)[0]


@pytest.mark.parametrize(
    ("over", "part"),
    [
        (np.zeros(0), "no full load cycle"),
        (np.full(100, 0.1), "no full load cycle"),
        (np.linspace(0, 0.2, 100), "extension branch is missing"),
        (np.linspace(0.2, 0, 100), "contraction branch is missing"),
        (np.array([0.0, 0.1, 0.2, 0.1, 0.0]), "different places"),
    ],
)
def test_what_is_no_cycle_is_refused(over, part):
    with pytest.raises(DataError, match=part):
        split_cycles(over, {"force": over}, 50)


def test_a_record_may_begin_and_end_within_a_cycle():
    pulse = np.interp(np.arange(90), [0, 50, 69, 70, 89], [0, 0, 1, 1, 0])
    x = np.concatenate([pulse, pulse, pulse, np.zeros(50)])
    assert cycle_starts(x[60:])[0] == 0  # half a rise is left
    assert len(cycle_starts(x[75:])) == 2  # a fall alone is no cycle
    assert len(cycle_starts(x[:-65])) == 3
    assert len(cycle_starts(x[:-85])) == 2  # the last rise has only begun
    assert len(cycle_starts(np.full(9, 2.0))) == len(cycle_starts(np.empty(0))) == 0
