"""The clock of a second log: recovered where the data tell it, refused where they do not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import t as student

from mapmore_cli.modelling.signals import shift as shifts
from mapmore_cli.modelling.signals.shift import (
    Shift,
    _half_width,
    _peak,
    _vertex,
    changes,
    correlation_by_lag,
    find_shift,
)

TIME = np.arange(0.0, 60.0, 0.05)
OTHER = np.arange(0.3, 55.0, 0.08)
COARSER = 0.08


def ramps(seed):
    """A quantity that goes to another random value every two seconds and a half."""
    knots, values = np.arange(-100.0, 200.0, 2.5), np.random.default_rng(seed).uniform(0, 300, 120)
    return lambda t: np.interp(t, knots, values)


def found(truth, shift, noise=0.0, seed=0):
    """The shift of a log whose clock shows `t - shift` at the time t."""
    random = np.random.default_rng(seed)
    first = truth(TIME) + noise * random.standard_normal(len(TIME))
    second = truth(OTHER + shift) + noise * random.standard_normal(len(OTHER))
    return find_shift(TIME, first, OTHER, second, same_sign=True)


def sure(shift):
    return not (shift.ambiguous or shift.lost_in_noise)


@settings(max_examples=25)
@given(st.floats(-10, 10), st.integers(0, 10_000), st.floats(0, 3))
@example(0.0, 0, 0.0)
@example(0.0, 2482, 0.0)  # by chance, another shift correlates well too, and is named
@example(
    -14.654927770943802,
    1592,
    0.0,
    # less than 0.3 of the changes overlap: at the edge of what is looked at, the correlation still
    # rises
)
def test_a_shared_quantity_tells_the_shift_to_half_a_sample(shift, seed, noise):
    one = found(ramps(seed), shift, noise, seed)
    assert sure(one) or (one.next_best > 0.85 and not one.lost_in_noise)
    assert one.value == pytest.approx(shift, abs=COARSER / 2)
    assert abs(one.value - shift) <= one.half_width
    assert one.step == pytest.approx(COARSER)


def waves(random):
    """A smooth quantity: sines of twelve random frequencies of 0.02 to 1 Hz."""
    hertz, phase = random.uniform(0.02, 1.0, 12), random.uniform(0, 2 * np.pi, 12)
    size = random.standard_normal(12) / np.hypot(1, 2 * hertz)
    return lambda t: size @ np.sin(2 * np.pi * np.outer(hertz, t) + phase[:, np.newaxis])


def drawn_noise(random, count, kind, step):
    """Noise of unit variance: independent, with outliers, or with a memory of 0.2 s."""
    if kind == "outliers":
        return random.standard_t(3, count) / np.sqrt(3)
    kept = np.exp(-step / 0.2) if kind == "slow" else 0.0
    return lfilter([np.sqrt(1 - kept**2)], [1, -kept], random.standard_normal(count))


def test_the_interval_holds_the_shift_as_often_as_it_says():
    """Changes over several samples go together: counted as independent, they made intervals so
    narrow that 75 % of these shifts lay inside.
    """
    random, inside = np.random.default_rng(7), []
    for number in range(300):
        steps = ((0.01, 0.013), (0.02, 0.013), (0.005, 0.03))[number % 3]
        kind = ("white", "outliers", "slow")[number // 3 % 3]
        truth, scale = (waves(random), 1.0) if number % 2 else (ramps(number), 1 / 90)
        level, shift = random.uniform(0.1, 0.5), random.uniform(-2, 2)
        times = np.arange(0.0, 30.0, steps[0]), np.arange(0.3, 27.0, steps[1])
        first, second = (
            scale * truth(time + late) + level * drawn_noise(random, len(time), kind, step)
            for time, late, step in zip(times, (0.0, shift), steps, strict=True)
        )
        one = find_shift(times[0], first, times[1], second, same_sign=True)
        if sure(one):
            inside.append(abs(one.value - shift) <= one.half_width)
    assert len(inside) > 150
    assert 0.9 <= np.mean(inside) <= 0.99


@settings(max_examples=25)
@given(st.floats(-20, 20), st.floats(5, 50), st.floats(0.2, 5))
def test_one_event_tells_it_too(shift, at, length):
    """A pulse may lie anywhere between two samples of either log."""
    one = found(lambda t: 5.0 * ((t > 25) & (t < 25 + length)), shift, 0.05)
    assert sure(one)
    assert abs(one.value - shift) <= one.half_width < 1.5 * COARSER


@pytest.mark.parametrize("kind", ["white", "walk", "slow"])
def test_noise_is_refused(kind):
    for seed in range(15):
        random = np.random.default_rng(seed)
        y, z = random.standard_normal(len(TIME)), random.standard_normal(len(OTHER))
        if kind == "walk":
            y, z = np.cumsum(y), np.cumsum(z)
        if kind == "slow":
            y, z = np.convolve(y, np.ones(20), "same"), np.convolve(z, np.ones(20), "same")
        one = find_shift(TIME, y, OTHER, z)
        assert one is None or not sure(one), seed


@settings(max_examples=15)
@given(st.floats(-5, 5), st.floats(2, 8), st.sampled_from(["sine", "square", "staircase"]))
@example(
    1.5, 7.75, "staircase"
)  # changes over one of the widths make the true peak and its neighbours look unlike
def test_several_equal_peaks_are_refused(shift, period, kind):
    waves = {
        "sine": lambda t: np.sin(2 * np.pi * t / period),
        "square": lambda t: np.sign(np.sin(2 * np.pi * t / period)),
        "staircase": lambda t: np.floor(t / period),
    }
    one = found(waves[kind], shift, 1e-3)
    assert one.ambiguous
    assert one.rival is not None


def test_a_quantity_that_falls_while_the_other_rises():
    truth = ramps(3)
    opposite = -2 * truth(OTHER + 4.0)
    one = find_shift(TIME, truth(TIME), OTHER, opposite)
    assert one.correlation < -0.9
    assert one.value == pytest.approx(4.0, abs=COARSER / 2)
    together = find_shift(TIME, truth(TIME), OTHER, opposite, same_sign=True)
    assert together is None or not sure(together)


def test_equal_records_differ_by_less_than_their_steps():
    y = ramps(1)(TIME)
    one = find_shift(TIME, y, TIME, y)
    assert (one.value, one.half_width) == pytest.approx((0.0, 0.05), abs=1e-9)


def test_nothing_changes():
    assert find_shift(TIME, np.ones(len(TIME)), OTHER, ramps(0)(OTHER)) is None


def test_a_record_of_eight_samples_is_long_enough():
    event = np.array([0.0, 0, 0, 5, 5, 5, 5, 5])
    assert find_shift(np.arange(8.0), event, np.arange(8.0), event) is not None
    jump = np.repeat([0.0, 1.0], 15)
    alone = _peak(jump, jump, 1, 0.0, 1.0, same_sign=True)
    assert (alone.next_best, alone.rival) == (0.0, None)
    assert find_shift(np.arange(7.0), event[:7], np.arange(8.0), event) is None
    assert find_shift(np.arange(8.0), event, np.arange(7.0), event[:7]) is None
    longer = np.append(event, 5.0)  # changes over two samples need more than eight
    assert _peak(longer, event, 2, 0.0, 1.0, same_sign=True) is None
    assert _peak(longer, longer, 2, 0.0, 1.0, same_sign=True) is not None


def test_a_peak_is_certain_if_it_is_high_above_noise_and_above_the_next_one():
    one = Shift(1.0, 0.1, 0.05, -0.92, 0.7, 3.0, 7.0)
    assert one.ratio == pytest.approx(0.92 / 0.7)
    assert sure(one)
    assert replace(one, next_best=0.801).ambiguous
    assert not replace(one, correlation=1.15 / 2, next_best=0.5).ambiguous
    assert not replace(one, next_best=0.799).ambiguous
    alone = replace(one, next_best=0.0, rival=None)
    assert (alone.ratio, alone.ambiguous) == (np.inf, False)
    assert replace(one, sigmas=6.99).lost_in_noise


@pytest.mark.parametrize("width", [1, 4])
def test_the_height_of_a_peak_is_fishers_z_over_its_standard_deviation(width):
    """Changes over w samples leave one independent value in 2 w of the overlap."""
    noise = 30 * np.random.default_rng(width).standard_normal((2, 600))
    first, second = [ramps(0)(0.1 * np.arange(600) + late) for late in (0, 2)] + noise
    one = _peak(first, second, width, 0.0, 0.1, same_sign=True)
    r, _, overlap = correlation_by_lag(changes(first, width), changes(second, width))
    independent = overlap[np.argmax(r)] / (2 * width)
    assert one.sigmas == pytest.approx(np.arctanh(r.max()) * np.sqrt(independent - 3))


def test_changes_are_differences_of_means():
    y = np.random.default_rng(0).normal(size=12)
    found = [y[i : i + 3].mean() - y[i - 3 : i].mean() for i in range(3, 10)]
    np.testing.assert_allclose(changes(y, 3), found)


@pytest.mark.parametrize("seed", range(20))
def test_the_correlation_is_pearsons_over_the_overlap(seed):
    """If this is half of the shorter record, and holds 0.3 of the squared changes of both."""
    random = np.random.default_rng(seed)
    u, v = random.standard_normal(40) ** 3, random.standard_normal(30)
    r, lags, overlap = correlation_by_lag(u, v)
    known = 0
    for place, lag in enumerate(lags.astype(int)):
        start, end = max(lag, 0), min(40, 30 + lag)
        assert overlap[place] == end - start
        parts = u[start:end], v[start - lag : end - lag]
        shares = [part @ part / (whole @ whole) for part, whole in zip(parts, (u, v), strict=True)]
        if end - start >= 15 and min(shares) >= 0.3:
            assert r[place] == pytest.approx(np.corrcoef(*parts)[0, 1], abs=1e-9)
            known += 1
        else:
            assert r[place] == 0
    assert known


def test_equal_records_correlate_by_exactly_one():
    for seed in range(20):
        u = np.random.default_rng(seed).standard_normal(60)
        for sign in (1, -1):
            r, lags, _ = correlation_by_lag(u, sign * u)
            assert np.abs(r).max() <= 1
            assert r[lags == 0] == pytest.approx(sign)


@pytest.mark.parametrize(
    ("size", "place"),
    [([1, 1, 1], 0), ([0, 1, 1], 0.5), ([1, 1, 0], -0.5), ([0, 3, 1], 0.1), ([2, 3, 0], -0.25)],
)
def test_a_peak_has_its_top_on_the_parabola_through_three_points(size, place):
    assert _vertex(np.array(size, dtype=float), 1) == pytest.approx(place)
    for end in (0, 2):
        assert _vertex(np.array(size, dtype=float), end) == 0


def test_the_half_width_is_that_of_noise_with_an_autocovariance():
    """Of 64 samples: `t sqrt(sum_k R(k) A(k)) / sum u' v'`, with the autocovariance R of the
    difference, and the sums A of products of the slope of the mean.
    """
    random = np.random.default_rng(5)
    truth = np.sin(np.arange(64) / 4)
    u, v = truth + 0.1 * random.standard_normal((2, 64))
    u, v = u - u.mean(), v - v.mean()
    v = v * np.sqrt(u @ u / (v @ v))
    slope, rest = np.gradient((u + v) / 2), u - v
    sums = [np.correlate(signal, signal, "full") for signal in (rest, slope)]
    variance = np.dot(*sums) / 64
    products = (np.abs(np.fft.rfft(slope, 128)) * np.abs(np.fft.rfft(rest, 128))) ** 2
    freedom = products.sum() ** 2 / (products @ products)
    expected = student.ppf(0.975, freedom) * np.sqrt(variance) / (np.diff(u) @ np.diff(v))
    assert _half_width(u, v, 0) == pytest.approx(expected, rel=1e-3)


def test_records_that_never_change_together_have_no_interval():
    u, v = np.array([[0.0, 0, 1, 1, 1, 1], [0.0, 0, 0, 0, 1, 1]])
    assert _half_width(u, v, 0) == np.inf
    assert np.isfinite(_half_width(u, v, -2))


def test_the_longer_record_has_a_bounded_number_of_grid_points(monkeypatch):
    sizes = []

    def peak(first, second, *_):
        sizes.append((len(first), len(second)))

    monkeypatch.setattr(shifts, "_peak", peak)
    monkeypatch.setattr(shifts, "MOST", 50)
    assert find_shift(np.arange(400.0), np.zeros(400), np.arange(200.0), np.zeros(200)) is None
    assert find_shift(np.arange(200.0), np.zeros(200), np.arange(400.0), np.zeros(400)) is None
    assert {*sizes} == {(50, 25), (25, 50)}


def test_of_smooth_records_without_noise_the_shift_is_told_to_a_tenth_of_a_sample():
    """The top of the peak lies between the samples."""
    for shift in (0.0, 1.234, -2.5, 3.017):
        one = found(lambda t: np.sin(t) + np.sin(0.37 * t) + 0.5 * np.sin(2.3 * t), shift)
        assert one.value == pytest.approx(shift, abs=0.1 * 0.05)
