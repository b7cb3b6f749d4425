from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.signals.sampling import average_repeated, spread_repeated

stamps = st.lists(st.integers(0, 3), min_size=1, max_size=40).map(lambda steps: np.cumsum(steps) * 0.001)


@settings(deadline=None)
@given(time=stamps, seed=st.integers(0, 2**31))
def test_averaging_leaves_each_stamp_once_with_the_mean_of_its_samples(time: np.ndarray, seed: int) -> None:
    force = np.random.default_rng(seed).normal(size=len(time))
    once, averaged = average_repeated(time, {"force": force, "time": time})
    assert (np.diff(once) > 0).all()
    assert set(once) == set(time)
    np.testing.assert_allclose(averaged["force"], [force[time == t].mean() for t in once], rtol=1e-12, atol=1e-15)


@settings(deadline=None)
@given(time=stamps)
def test_spreading_makes_stamps_unique_without_reaching_the_next(time: np.ndarray) -> None:
    spread = spread_repeated(time)
    first = np.concatenate([[True], np.diff(time) > 0])
    np.testing.assert_array_equal(spread[first], time[first])
    if len(np.unique(time)) > 1:
        assert (np.diff(spread) > 0).all()
    else:
        np.testing.assert_array_equal(spread, time)


def test_spreading_is_even() -> None:
    np.testing.assert_allclose(spread_repeated(np.array([0.0, 1.0, 1.0, 3.0, 3.0, 3.0])), [0, 1, 2, 3, 3 + 2 / 3, 3 + 4 / 3])
