"""Stamps of a clock as loggers write them: repeats, gaps, resets, other stamps, rates."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reading import refused
from scipy.signal import savgol_filter

from mapmore_cli.domain import arrays
from mapmore_cli.modelling.signals import rates, sampling
from mapmore_cli.modelling.signals.rates import rate, running_median
from mapmore_cli.modelling.signals.sampling import (
    align,
    average_repeated,
    correlation,
    cut_after,
    envelope,
    even_parts,
    even_share,
    find_gaps,
    find_resets,
    resample,
    spread_repeated,
    typical_step,
)


@given(st.lists(st.floats(-9, 9), min_size=1, max_size=60), st.integers(2, 12), st.booleans())
def test_an_envelope_has_the_ends_of_every_run(values, limit, less):
    y = np.array(values)
    y[::7] = np.nan
    drawn = y - np.arange(len(y)) if less else y
    rows = envelope(y, limit, 1.0 * np.arange(len(y)) if less else None).tolist()
    if len(y) <= limit:
        assert rows == [*range(len(y))]
        return
    assert len(rows) <= limit
    edges = np.linspace(0, len(y), limit // 2 + 1).astype(int).tolist()
    for start, end in pairwise(edges):
        own = [row for row in rows if start <= row < end]
        known = drawn[start:end][np.isfinite(drawn[start:end])]
        if not len(known):
            assert own == [start]
        else:
            assert {min(drawn[own]), max(drawn[own])} == {known.min(), known.max()}
            assert len(own) == 2 - (known.min() == known.max() or own[0] == own[-1])


def test_a_curve_within_the_limit_is_shown_whole():
    assert envelope(np.zeros(4), 4).tolist() == [0, 1, 2, 3]
    assert len(envelope(np.zeros(6), 4)) == 2


def test_shares_and_parts_of_long_records_are_even(monkeypatch):
    assert [len(even_share(np.arange(n), 10)) for n in (10, 11, 20, 21, 100)] == [
        10,
        10,
        10,
        10,
        10,
    ]
    assert even_share(np.arange(28.0), 10).tolist() == [*range(0, 28, 3)]
    monkeypatch.setattr(arrays, "LONG", 100)  # bytes from which on a column is kept in a file
    table = np.arange(84.0).reshape(28, 3)
    assert even_share(table, 10).tolist() == table[::3].tolist()
    assert sum(part.stop - part.start for part in even_parts(10**9)) == 2**20
    monkeypatch.setattr(sampling, "PARTS", 3)
    monkeypatch.setattr(sampling, "PART", 4)
    assert even_parts(12) == [slice(0, 12)]
    assert even_parts(20) == [slice(0, 4), slice(8, 12), slice(16, 20)]


def test_the_correlation_does_not_hang_on_the_size():
    rng = np.random.default_rng(0)
    u, v = rng.normal(size=(2, 30))
    expected = np.corrcoef(u, v)[0, 1]
    for size in (1.0, 1e-200, 1e200):
        assert correlation(size * u, size * v) == pytest.approx(expected)
    assert correlation(u, np.ones(30)) == correlation(np.ones(30), u) == 0.0


def test_from_one_and_a_half_samples_a_step_they_are_averaged():
    time, x = np.arange(7.0), np.array([0.0, 1, 5, 2, 8, 3, 1])
    assert resample(time, {"x": x}, 1.49)[1]["x"].tolist() == pytest.approx(
        np.interp(1.49 * np.arange(5), time, x).tolist()
    )
    stamps, columns = resample(time, {"x": x}, 1.5)  # blocks of two and one samples
    middles, means = [0.5, 2.0, 3.5, 5.0], [0.5, 5.0, 5.0, 3.0]
    assert stamps.tolist() == [0.25, 1.75, 3.25, 4.75]
    np.testing.assert_allclose(columns["x"], np.interp(stamps, middles, means))


stamps = st.lists(st.integers(0, 3), min_size=1, max_size=40).map(
    lambda steps: np.cumsum(steps) * 0.001
)


@given(time=stamps, seed=st.integers(0, 2**31))
def test_averaging_leaves_each_stamp_once_with_the_mean_of_its_samples(time, seed):
    force = np.random.default_rng(seed).normal(size=len(time))
    once, averaged = average_repeated(time, {"force": force, "time": time})
    assert (np.diff(once) > 0).all()
    assert set(once) == set(time)
    np.testing.assert_allclose(
        averaged["force"], [force[time == t].mean() for t in once], rtol=1e-12, atol=1e-15
    )


def test_spreading_is_even():
    np.testing.assert_allclose(
        spread_repeated(np.array([0.0, 1.0, 1.0, 3.0, 3.0, 3.0])),
        [0, 1, 2, 3, 3 + 2 / 3, 3 + 4 / 3],
    )
    assert spread_repeated(np.ones(3)).tolist() == [1, 1, 1]


@given(
    sizes=st.lists(st.integers(2, 30), min_size=1, max_size=6),
    missing=st.lists(st.integers(5, 500), min_size=5, max_size=5),
    step=st.sampled_from([0.001, 0.02, 0.1, 7.0]),
)
def test_planted_gaps_are_found_and_their_samples_counted(sizes, missing, step):
    counts = np.concatenate(
        [np.arange(size) + sum(sizes[:i]) + sum(missing[:i]) for i, size in enumerate(sizes)]
    )
    gaps = find_gaps(counts * step, 3 * step)
    np.testing.assert_array_equal(gaps.after, np.cumsum(sizes)[:-1] - 1)
    np.testing.assert_allclose(gaps.lengths, (np.array(missing[: len(sizes) - 1]) + 1) * step)
    assert gaps.samples_missing == sum(missing[: len(sizes) - 1])
    assert [part.stop - part.start for part in cut_after(len(counts), gaps.after)] == sizes


@pytest.mark.parametrize("start", [0.0, 1e4, 1.6e9])
def test_step_of_exactly_the_limit_is_no_gap(start):
    assert len(find_gaps(start + np.arange(1000) * 0.01, 0.01)) == 0
    assert len(find_gaps(np.zeros(3), 0.0)) == 0


def test_repeated_stamps_do_not_hide_the_usual_step_and_resets_are_found():
    time = np.repeat(np.arange(10.0), 3)
    assert (typical_step(time), typical_step(np.zeros(4))) == (1.0, 0.0)
    assert find_gaps(np.append(time, 19.0), 2.0).samples_missing == 9
    assert cut_after(6, find_resets(np.array([0, 1, 1, 0.5, 2, 0]))) == [
        slice(0, 3),
        slice(3, 5),
        slice(5, 6),
    ]


times = st.lists(st.integers(-50, 50), min_size=1, max_size=30, unique=True).map(
    lambda stamps: np.array(sorted(stamps), dtype=float)
)


@given(
    time=times,
    stamps=st.lists(st.floats(-60, 60), min_size=1, max_size=40),
    max_gap=st.one_of(st.none(), st.floats(0.5, 20)),
)
def test_every_value_lies_between_two_near_samples_or_is_missing(time, stamps, max_gap):
    values = 2 * time - 1
    aligned = align(np.array(stamps), time, values, max_gap)
    for stamp, value in zip(stamps, aligned, strict=True):
        before, after = time[time <= stamp], time[time >= stamp]
        near = (
            len(before)
            and len(after)
            and (max_gap is None or after[0] - before[-1] <= max_gap * (1 + 1e-9))
        )
        if near:
            np.testing.assert_allclose(value, 2 * stamp - 1, atol=1e-9)
        else:
            assert np.isnan(value)


def test_own_stamps_keep_their_values_on_both_sides_of_a_gap():
    time, values = np.array([0.0, 1.0, 9.0, 10.0]), np.array([5.0, 6.0, 7.0, 8.0])
    for max_gap in (0.0, 2.0):
        np.testing.assert_array_equal(align(time, time, values, max_gap), values)
    np.testing.assert_array_equal(
        align(np.array([1.5, np.nan, -0.1, 10.1]), time, values, 2.0), [np.nan] * 4
    )


def rounded_stamps(seed, n):
    """Stamps at about 550 Hz as a logger writes them: jittered, rounded to 1 ms, some repeating."""
    steps = np.random.default_rng(seed).uniform(0.0008, 0.0028, n)
    return np.round(np.cumsum(steps), 3)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("half", [3, 5, 12])
def test_even_stamps_give_the_filter_of_scipy_ends_included(order, half):
    step = 0.01
    time = 7.0 + step * np.arange(200)
    values = np.random.default_rng(order).normal(size=200)
    expected = savgol_filter(values, 2 * half + 1, order, deriv=1, delta=step, mode="interp")
    np.testing.assert_allclose(
        rate(time, values, 2 * half * step, order), expected, rtol=1e-8, atol=1e-8
    )


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31), row=st.integers(0, 149), order=st.integers(1, 5))
def test_uneven_stamps_give_the_slope_of_a_fit_to_the_window(seed, row, order):
    time = rounded_stamps(seed, 150)
    values = np.random.default_rng(seed + 1).normal(size=150)
    begin = np.clip(time[row] - 0.02, time[0], time[-1] - 0.04)
    inside = (time >= begin - 1e-9) & (time <= begin + 0.04 + 1e-9)
    slope = np.polyfit(time[inside] - time[row], values[inside], order)[-2]
    assert rate(time, values, 0.04, order)[row] == pytest.approx(slope, rel=1e-6, abs=1e-6)


@given(st.integers(0, 2**31), st.sampled_from([0.4, 1.0, 2.0]))
def test_running_medians_are_of_half_a_window_around_each_point(seed, window):
    """Samples lie on a grid of 0.1, so that some stand right on the rim, and in no order."""
    rng = np.random.default_rng(seed)
    x, y = np.append([0.0, 4.0], rng.integers(0, 40, 30) / 10), rng.normal(size=32)
    found = running_median(x, y, window)
    points = np.arange(round(40 / window) + 1) * window / 10
    near = [np.abs(x - point) < window / 4 + 1e-6 for point in points]
    known = [at.any() for at in near]
    for values, medians in zip((x, y), found, strict=True):
        own = [np.median(values[at]) for at in near if at.any()]
        np.testing.assert_allclose(medians, np.interp(points, points[known], own), atol=1e-9)


def test_an_offset_of_a_quantity_costs_no_digits():
    time = rounded_stamps(1, 500)
    far = 1e9 + np.sin(9 * time)
    values = far - 1e9  # exact
    np.testing.assert_allclose(rate(time, far, 0.04, 3), rate(time, values, 0.04, 3), atol=1e-9)
    for pair in ((far, time), (time, far)):
        assert correlation(*pair) == pytest.approx(correlation(values, time), rel=1e-12)


def test_blocks_do_not_show(monkeypatch):
    time = rounded_stamps(1, 500)
    values = np.sin(9 * time)
    whole = rate(time, values, 0.04, 3)
    sizes = []

    def counted(time, values, at, *more):
        sizes.append(len(at))
        return slopes(time, values, at, *more)

    slopes = rates._slopes
    monkeypatch.setattr(rates, "_slopes", counted)
    for block, rows in ((70, 2), (1, 1)):  # of windows of at most 35 samples
        sizes.clear()
        monkeypatch.setattr(rates, "BLOCK", block)
        np.testing.assert_allclose(rate(time, values, 0.04, 3), whole, rtol=1e-10)
        assert max(sizes) == rows


@pytest.mark.parametrize(
    ("time", "window", "order", "parts"),
    [
        (0.01 * np.arange(50), 0.02, 3, ["0.02 s", "3 different", "needs 4", "wider"]),
        (np.repeat([0.0, 1.0, 2.0], 40), 2.0, 3, ["3 different", "needs 4"]),
        (np.array([0.0]), 1.0, 1, ["1 different"]),
        (np.array([0.0, 1e-160, 2e-160, 3e-160]), 1.0, 3, ["too close together", "wider"]),
        (np.array([0.0, 0.01, 0.02, 0.03, 5.0]), 0.03, 2, ["t = 5 s", "1 different"]),
    ],
)
def test_window_with_too_few_stamps_says_what_to_do(time, window, order, parts):
    with refused(*parts):
        rate(time, time**2, window, order)


@given(
    n=st.integers(2, 400),
    ratio=st.floats(0.1, 30),
    slope=st.floats(-100, 100),
    start=st.floats(-1e3, 1e3),
    jitter=st.floats(0, 0.3),
    seed=st.integers(0, 99),
)
def test_straight_lines_stay_straight_on_even_stamps(n, ratio, slope, start, jitter, seed):
    rng = np.random.default_rng(seed)
    time = start + 0.01 * (np.arange(n) + jitter * rng.uniform(-1, 1, n))
    step = 0.01 * ratio
    stamps, columns = resample(time, {"time": time, "x": 3 + slope * (time - start)}, step)
    assert list(columns) == ["x"]
    np.testing.assert_allclose(np.diff(stamps), step, rtol=1e-6)
    assert len(stamps) >= int((time[-1] - time[0]) / step)
    means_inside = slice(1, -1)  # at both ends, the first and the last mean are held
    np.testing.assert_allclose(
        columns["x"][means_inside],
        (3 + slope * (stamps - start))[means_inside],
        atol=1e-6 * (1 + abs(slope)),
    )


@pytest.mark.parametrize("samples", [2, 3, 10])
def test_blocks_of_an_even_record_are_plain_means(samples):
    time = 5 + 0.001 * np.arange(12 * samples + 1)
    x = np.random.default_rng(1).normal(size=len(time))
    stamps, columns = resample(time, {"x": x}, 0.001 * samples)
    np.testing.assert_allclose(
        columns["x"], x[: 12 * samples].reshape(12, samples).mean(axis=1), atol=1e-9
    )
    np.testing.assert_allclose(
        stamps, time[: 12 * samples].reshape(12, samples).mean(axis=1), rtol=0, atol=1e-9
    )


@pytest.mark.parametrize(("step", "first"), [(1.45, 0.0), (1.5, 0.25), (1.55, 0.275)])
def test_a_step_of_one_and_a_half_samples_is_averaged(step, first):
    time = np.arange(12.0)
    stamps, _ = resample(time, {}, step)
    assert stamps[0] == pytest.approx(first)


def test_stamps_of_a_calendar_hold_their_windows_up_to_their_rounding():
    """The stamps of a day in the year 2023 are rounded to 2e-7 s, so that a sample on the edge of a
    window may seem to lie beyond.
    """
    time, values = 0.01 * np.arange(300), np.random.default_rng(1).normal(size=300)
    found = rate(1.7e9 + time, values, 0.06, 2)
    np.testing.assert_allclose(found, rate(time, values, 0.06, 2), atol=0.5)


def test_finer_steps_are_interpolated_and_coarser_ones_than_the_record_say_nothing():
    time, x = np.array([0.0, 1.0, 2.0]), np.array([0.0, 4.0, 0.0])
    stamps, columns = resample(time, {"x": x}, 0.25)
    np.testing.assert_allclose(stamps, np.arange(9) * 0.25)
    np.testing.assert_allclose(columns["x"], [0, 1, 2, 3, 4, 3, 2, 1, 0])
    stamps, columns = resample(0.1 * time, {"x": x}, 1.0)
    assert stamps.size == columns["x"].size == 0
