"""Where cycles begin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.cycles import cycle_starts, last_cycles


def pulses(heights, rest=50, rise=20, noise=0.0, drift=0.0, seed=0):
    """Rest, rise, fall, and so on; where each rise begins."""
    parts, starts, now = [], [], 0
    for height in heights:
        parts += [np.zeros(rest), np.linspace(0, height, rise), np.linspace(height, 0, rise)]
        starts.append(now + rest)
        now += rest + 2 * rise
    x = np.concatenate([*parts, np.zeros(rest)])
    return x + drift * np.arange(len(x)) / len(x) + noise * np.random.default_rng(seed).uniform(-1, 1, len(x)), np.array(starts)


@settings(deadline=None)
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


@pytest.mark.parametrize(("count", "share", "first"), [(4, 0.5, 2), (3, 0.5, 2), (5, 0.5, 3), (4, 0.25, 3), (3, 1 / 3, 2), (4, 0.7, 2)])
def test_whole_cycles_are_held_out_with_the_rest_after_them(count, share, first):
    x, starts = pulses([1.0] * count)
    held = last_cycles(x, share)
    assert abs(int(np.argmax(held)) - starts[first]) <= 2
    assert held[np.argmax(held) :].all()


@pytest.mark.parametrize(("count", "share"), [(0, 0.5), (1, 0.5), (4, 0.1), (4, 1.0)])
def test_cycles_that_cannot_be_parted_are_refused(count, share):
    x = pulses([1.0] * count)[0] if count else np.zeros(50)
    with pytest.raises(DataError, match=rf"^{count} cycle\(s\) were found"):
        last_cycles(x, share)
