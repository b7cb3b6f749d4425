"""What recordings show: settling, copies of a signal, spikes, and outputs that differ at equal
inputs.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import recording

from mapmore_cli.checking import evidence
from mapmore_cli.checking.evidence import (
    Unequal,
    _left,
    same_signals,
    settling,
    spikes,
    two_digits,
    unequal,
)
from mapmore_cli.modelling.expressions.operator import from_rest, linear

T = np.arange(0, 40, 0.02)


def test_one_signal_in_two_units_is_found_and_a_loop_is_none():
    one = np.sin(T)
    assert same_signals([one, np.cos(T), 7 - 3 * one]) == [[0, 2]]
    assert same_signals([one, one + 0.1 * np.cos(T)]) == []
    assert same_signals([np.ones(400), np.ones(400)]) == []


@st.composite
def smooth_signals(draw):
    """Sums of slow waves with normal noise of any size, as records of a sensor are."""
    n, seed = draw(st.integers(30, 3000)), draw(st.integers(0, 2**32 - 1))
    rng, time = np.random.default_rng(seed), np.arange(n)
    waves = [
        rng.normal() * np.sin(2 * np.pi * time * rng.uniform(0, 1 / 12) + rng.uniform(0, 7))
        for _ in range(draw(st.integers(1, 5)))
    ]
    noisy = sum(waves) + 10 ** draw(st.floats(-6, 1)) * rng.normal(size=n)
    resolution = draw(st.sampled_from([0.0, 1e-3, 0.05, 0.5]))  # of the converter
    return np.round(noisy / resolution) * resolution if resolution else np.asarray(noisy)


@given(smooth_signals())
def test_noise_has_no_spikes(values):
    assert not spikes(values).size


@given(st.integers(30, 2000), st.integers(0, 2**32 - 1), st.sampled_from(["two", "many", "steps"]))
def test_commands_and_steps_have_no_spikes(n, seed, kind):
    rng = np.random.default_rng(seed)
    held = rng.geometric(rng.uniform(0.02, 1.0), size=n)
    if kind == "steps":
        values = np.cumsum(rng.normal(size=n) * (rng.random(n) < 3 / n))
        values = from_rest(linear([0.7], [0.3]), values) + 1e-3 * rng.normal(size=n)
    else:
        values = np.repeat(
            rng.integers(0, 2, size=n) if kind == "two" else rng.uniform(size=n), held
        )[:n].astype(float)
    assert not spikes(values).size


@given(
    st.integers(40, 1000),
    st.integers(0, 2**32 - 1),
    st.floats(1.0, 100.0),
    st.sampled_from([-1.0, 1.0]),
)
def test_a_sample_that_left_the_range_is_a_spike(n, seed, height, sign):
    rng = np.random.default_rng(seed)
    values = np.sin(np.arange(n) * rng.uniform(0.01, 0.1)) + 0.01 * rng.normal(size=n)
    place = int(rng.integers(1, n - 1))
    values[place] += sign * (2 + height)
    assert list(spikes(values)) == [place]


@pytest.mark.parametrize(
    ("step", "unit", "window"), [(0.02, "s", 0.16), (0.02, "ms", 0.16), (0.001, "s", 0.1)]
)
def test_shares_of_settled_samples_at_two_rates(step, unit, window):
    """A pressure that rises 30 at 3 per second, and 70 at 5: 4 is settled, of a range of 100."""
    seconds = np.arange(0, 24, step)
    time = seconds * {"s": 1, "ms": 1000}[unit]
    pressure = 20 + np.where(seconds < 10, 3 * seconds, 30 + 5 * (seconds - 10))
    settled = settling([recording(time=time, pressure=pressure)], unit)
    assert (settled.limit, settled.window) == (4.0, window)
    assert settled.share == pytest.approx(10 / 24, abs=0.005)
    assert settled.share_between == pytest.approx(20 / 3 / (20 / 3 + 12), abs=0.005)
    halves = zip(np.split(time, [600]), np.split(pressure, [600]), strict=True)
    parts = [recording(time=t, pressure=p) for t, p in halves]
    assert settling(parts, unit).share == pytest.approx(settled.share, abs=0.01)


def test_a_pressure_at_a_tenth_from_an_end_of_its_range_is_not_in_the_middle():
    pressure = np.repeat([0.0, 10.0, 90.0, 100.0], 500)
    settled = settling([recording(time=0.02 * np.arange(2000), pressure=pressure)])
    assert (settled.share > 0.9, settled.share_between) == (True, 0.0)


def test_no_rate_without_a_clock_that_goes_on():
    pressure = np.sin(T)
    repeated = np.where(np.arange(len(T)) == 1000, T[999], T)
    assert settling([recording(time=repeated, pressure=pressure)]) is not None
    assert settling([recording(time=T, pressure=0 * T + 100)]) is None
    for time in (0 * T, np.where(T == 20, 0, T), np.where(T < 20, T, T + 100)[:1002]):
        assert settling([recording(time=time, pressure=pressure[: len(time)])]) is None


def test_as_a_person_rounds():
    numbers = [0.0123, 0.456, 9.96, 10.4, 123, 98765, 1.0]
    assert [two_digits(each) for each in numbers] == [0.012, 0.46, 10, 10, 120, 99000, 1]


def test_how_alike_signals_have_to_be_to_be_one():
    rng = np.random.default_rng(3)
    noise = rng.normal(size=len(T))
    noise /= noise.std()
    for share, same in ((0.012, True), (0.02, False)):  # a correlation of 1 - share^2 / 2
        assert bool(same_signals([np.sin(T), np.sin(T) + share * np.sin(T).std() * noise])) == same
    assert same_signals([T[:30], -T[:30]]) == [[0, 1]]
    assert same_signals([T[:29], -T[:29]]) == same_signals([T, T[:-1]]) == []
    assert same_signals([T, T**2, 3 - T**2, 1 + T, T * 2]) == [[0, 3, 4], [1, 2]]


@pytest.mark.parametrize(
    ("gain", "offset", "both", "effects"),
    [
        (0.4, 0.6, 0.21, ["gain"]),
        (0.6, 0.4, 0.21, ["offset"]),
        (0.4, 0.6, 0.19, ["offset", "gain"]),
        (0.4, 0.6, 0.2, ["gain"]),
        (0.5, 0.6, 0.3, []),
        (0.51, 0.6, 0.26, []),
        (0.51, 0.6, 0.25, ["offset", "gain"]),
        (0.49, 0.6, 0.25, ["gain"]),
        (0.05, 0.6, 0.001, ["gain"]),
        (0.06, 0.6, 0.001, ["offset", "gain"]),
    ],
)
def test_effects_that_explain_most_of_a_difference(gain, offset, both, effects):
    one, other = (recording(name, u=[]) for name in "ab")
    for apart in (1.0, 0.05):
        left = {"gain": gain * apart, "offset": offset * apart, "offset gain": both * apart}
        found = Unequal(one, other, ("u", "p"), "force", apart, left)
        assert found.effects == effects
        assert found.is_large == (apart == 1.0)
    words = f"explains {1 - gain**2:.0%} of the difference, an offset {1 - offset**2:.0%}, both "
    assert words in found.words()
    assert found.words().startswith(
        "b.csv has the same u, p as a.csv, but force differs by 0.05 of"
    )


def test_the_two_recordings_that_differ_most_are_told(monkeypatch):
    u = np.sin(np.arange(60.0))
    outputs = [u, u + 0.2, u + 0.5, u + 0.3]
    recordings = [recording(str(k), u=u, force=y) for k, y in enumerate(outputs)]
    recordings.append(recording("4", u=-u, force=4 * u))
    found = unequal(recordings, ["u"], "force")
    assert (found.one.id, found.other.id) == ("0", "2")
    assert found.apart == pytest.approx(0.5 / np.ptp([4 * u.min(), 4 * u.max()]))
    assert found.left["offset"] == pytest.approx(0, abs=1e-9)
    short = [recording(u=u[:n], force=u[:n] + n) for n in (29, 60)]
    assert unequal(short, ["u"], "force") is None
    wide = 10 * np.sin(np.arange(300.0)) + 7
    for off, told in ((0.009, True), (0.011, False)):
        near = [wide, wide + off * np.ptp(wide) * np.where(np.arange(300) % 2, 1, -1)]
        equal = [recording(u=x, force=wide + k) for k, x in enumerate(near)]
        assert (unequal(equal, ["u"], "force") is not None) == told
    for n, told in ((29, False), (30, True)):
        both = [recording(u=u[:n], force=u[:n] + 1), recording(u=u, force=u)]
        for parts in (both, both[::-1]):
            assert (unequal(parts, ["u"], "force") is not None) == told
    for lowest, told in ((99.0, False), (98.9, True)):  # held to a hundredth of the largest value
        held = np.linspace(lowest, 100, 60)
        parts = [recording(u=held, force=u), recording(u=held, force=u + 1)]
        assert (unequal(parts, ["u"], "force") is not None) == told
    apart, left = _left(u, 0.4 * u + 0.1)
    assert (apart, left) == _left(0.4 * u + 0.1, u)
    assert left["offset gain"] == pytest.approx(0, abs=1e-9)
    monkeypatch.setattr(evidence, "COMPARED", 2)  # every third of five is compared
    found = unequal(recordings, ["u"], "force")
    assert (found.one.id, found.other.id) == ("0", "3")


@pytest.mark.parametrize(
    ("values", "rows"),
    [
        ({15: 4.1}, [15]),  # the steps elsewhere are 1
        ({15: 3.9}, []),
        ({15: -4.1}, [15]),
        ({15: 10.1, 16: 2.0}, [15]),  # its neighbours differ by 2, and it is higher by 8.1
        ({15: 10.0, 16: 2.0}, [15]),
        ({15: 9.9, 16: 2.0}, []),
        ({15: 4.0}, []),
        ({15: 40.0, 20: 11.0}, [15, 20]),  # both are higher than a quarter of the highest
        ({15: 40.0, 20: 9.0}, [15]),
        ({0: 40.0}, []),
        ({28: 40.0}, [28]),
        ({29: 40.0}, []),
    ],
)
def test_a_spike_is_four_times_as_high_as_any_other_change(values, rows):
    record = np.arange(400) % 2.0 if len(rows) > 1 else np.arange(30) % 2.0
    record[[*values]] = [*values.values()]
    for place in values:
        if not {place - 1, place + 1} & {*values}:
            record[place + 1 : place + 2] = record[place - 1]
    assert spikes(record).tolist() == rows
    assert not spikes(record[:29]).size


@pytest.mark.parametrize(("top", "rows"), [(5.0, []), (5.1, [15])])
def test_a_spike_in_a_valley_is_higher_than_four_steps_of_its_sides(top, rows):
    valley = np.abs(np.arange(31.0) - 15)
    valley[15] = top
    assert spikes(valley).tolist() == rows


def test_a_spike_is_a_quarter_of_the_range_and_seldom():
    slow = np.linspace(0, 100, 400)
    for height, rows in ((24, []), (26, [200])):
        record = slow + height * (np.arange(400) == 200)
        assert spikes(record).tolist() == rows
    assert spikes(np.where(np.arange(40) == 7, 5.0, 1.0)).tolist() == []  # no other change
    for count, found in ((4, 4), (5, 0)):
        record = np.where(np.isin(np.arange(400), 50 * np.arange(1, count + 1)), 90.0, slow / 100)
        assert len(spikes(record)) == found
