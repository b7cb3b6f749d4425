"""Cycles: their branches, and where strokes begin."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.cycles import (
    _trimmed_runs,
    cycle_starts,
    last_cycles,
    split_cycles,
    turning_points,
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


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**31), noise=st.floats(0, 0.003), step=st.sampled_from([0.0, 1e-4, 1e-3])
)
def test_noise_and_quantisation_do_not_split_a_branch(seed, noise, step):
    over, force = loop(2500, cycles=2, rest=400)
    rng = np.random.default_rng(seed)
    seen = over + REACH * noise * rng.normal(size=len(over))
    seen = np.round(seen / step) * step if step else seen
    assert len(turning_points(seen, 0.1 * float(np.ptp(seen)))) == 5
    branches = split_cycles(seen, {"force": force + rng.normal(0, 1, len(force))}, 100)
    inner = slice(5, -5)
    np.testing.assert_allclose(
        branches.static()["force"][inner], static(branches.over)[inner], atol=4
    )
    assert (branches.hysteresis("force")[inner] > 0).all()


def test_rest_at_the_end_of_the_stroke_belongs_to_no_branch():
    over, force = loop(500, rest=5000)
    branches = split_cycles(over, {"force": force}, 100)
    np.testing.assert_allclose(
        branches.hysteresis("force")[[0, -1]], half_width(branches.over[[0, -1]]), atol=0.2
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


@given(seed=st.integers(0, 2**31), swing=st.floats(0.05, 3))
def test_turning_points_alternate_and_are_a_swing_apart(seed, swing):
    walk = np.cumsum(np.random.default_rng(seed).normal(size=300))
    turns = turning_points(walk, swing)
    steps = np.diff(walk[turns])
    assert (np.abs(steps) >= swing).all()
    assert (steps[1:] * steps[:-1] < 0).all()
    for begin, end in pairwise(turns):
        piece = walk[begin : end + 1]
        assert {piece.min(), piece.max()} == {walk[begin], walk[end]}
    assert walk[turns].max() == walk.max()
    assert walk[turns].min() == walk.min()


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


def pulses(heights, noise=0.0, drift=0.0, seed=0):
    """Rest, rise, fall, and so on; where each rise begins."""
    parts, starts, now = [], [], 0
    for height in heights:
        parts += [np.zeros(50), np.linspace(0, height, 20), np.linspace(height, 0, 20)]
        starts.append(now + 50)
        now += 90
    x = np.concatenate([*parts, np.zeros(50)])
    return x + drift * np.arange(len(x)) / len(x) + noise * np.random.default_rng(seed).uniform(
        -1, 1, len(x)
    ), np.array(starts)


@given(
    st.lists(st.floats(0.6, 1.0), min_size=1, max_size=6),
    st.floats(0, 0.01),
    st.floats(-0.1, 0.1),
    st.integers(0, 99),
    st.floats(1e-3, 1e6),
    st.floats(-1e3, 1e3),
)
def test_cycles_begin_where_rest_ends(heights, noise, drift, seed, slope, offset):
    x, starts = pulses([1.0, *heights], noise=noise, drift=drift, seed=seed)
    found = cycle_starts(slope * (x + offset))
    assert len(found) == len(starts)
    assert (np.abs(found - starts) <= 4).all()


def test_a_dip_at_the_top_and_a_ripple_at_rest_are_no_cycles():
    x, starts = pulses([1.0, 1.0])
    x[65:75] -= 0.2
    x[100:110] += 0.1
    assert len(cycle_starts(x)) == len(starts)


def test_a_record_may_begin_and_end_within_a_cycle():
    x, _ = pulses([1.0, 1.0, 1.0])
    assert cycle_starts(x[60:])[0] == 0  # half a rise is left
    assert len(cycle_starts(x[75:])) == 2  # a fall alone is no cycle
    assert len(cycle_starts(x[:-65])) == 3
    assert len(cycle_starts(x[:-85])) == 2  # the last rise has only begun
    assert len(cycle_starts(np.full(9, 2.0))) == len(cycle_starts(np.empty(0))) == 0


@pytest.mark.parametrize(
    ("count", "share", "first"),
    [(4, 0.5, 2), (3, 0.5, 2), (5, 0.5, 3), (4, 0.25, 3), (3, 1 / 3, 2), (4, 0.7, 2)],
)
def test_whole_cycles_are_held_out_with_the_rest_after_them(count, share, first):
    x, starts = pulses([1.0] * count)
    held = last_cycles(x, share)
    assert abs(int(np.argmax(held)) - starts[first]) <= 2
    assert held[np.argmax(held) :].all()


@pytest.mark.parametrize(("count", "share"), [(0, 0.5), (1, 0.5), (4, 0.1), (4, 1.0)])
def test_cycles_that_cannot_be_parted_are_refused(count, share):
    with pytest.raises(DataError, match=rf"^{count} cycle\(s\) were found"):
        last_cycles(pulses([1.0] * count)[0], share)
