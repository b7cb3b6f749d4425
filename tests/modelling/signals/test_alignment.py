from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.signals.sampling import align

times = st.lists(st.integers(-50, 50), min_size=1, max_size=30, unique=True).map(lambda stamps: np.array(sorted(stamps), dtype=float))


@settings(deadline=None)
@given(time=times, stamps=st.lists(st.floats(-60, 60), min_size=1, max_size=40), max_gap=st.one_of(st.none(), st.floats(0.5, 20)))
def test_every_value_lies_between_two_near_samples_or_is_missing(time: np.ndarray, stamps: list[float], max_gap: float | None) -> None:
    values = 2 * time - 1
    aligned = align(np.array(stamps), time, values, max_gap)
    for stamp, value in zip(stamps, aligned, strict=True):
        before, after = time[time <= stamp], time[time >= stamp]
        near = len(before) and len(after) and (max_gap is None or after[0] - before[-1] <= max_gap * (1 + 1e-9))
        if near:
            np.testing.assert_allclose(value, 2 * stamp - 1, atol=1e-9)
        else:
            assert np.isnan(value)


def test_own_stamps_keep_their_values_on_both_sides_of_a_gap() -> None:
    time, values = np.array([0.0, 1.0, 9.0, 10.0]), np.array([5.0, 6.0, 7.0, 8.0])
    np.testing.assert_array_equal(align(time, time, values, 2.0), values)
    np.testing.assert_array_equal(align(np.array([1.5, np.nan, -0.1, 10.1]), time, values, 2.0), [np.nan] * 4)
