"""Sections as linear filters, against a loop over samples; switching; the published rows used
directly; errors over one wavelength.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_samples import BOUNDARIES, ROWS, STEP, coefficients, looped, published, sine, stepped
from motion_tables import continued

from mapmore_cli.annexes.motion.body import BUMPLESS, CARRIED, REST, ZERO, StateSpace, poles
from mapmore_cli.annexes.motion.model import motion_inputs
from mapmore_cli.annexes.motion.simulation import (
    EDGE,
    active,
    angles,
    last_wavelength,
    motion_errors,
    of_angles,
    response,
    rising,
    shared,
    simulate,
    spread,
    stable,
)
from mapmore_cli.domain.errors import DataError, FitError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.kinds import parameters, predict, runs_over_time, verbs_of
from mapmore_cli.modelling.memory.records import AtSample

MODELS = ("linear", "inflate_deflate", "piecewise", "piecewise_inflate_deflate")
STARTS = {REST: None, ZERO: 0.0}
reflected = st.floats(-EDGE, EDGE)


def run(motion, u):
    return simulate(motion, {"time": STEP * np.arange(len(u)), "input": u})


def switched(motion, u, start):
    """Sections that hand one state on, sample by sample; an input that stands still falls (P eq
    15-17).
    """
    numbers = [
        2 * sum(now >= boundary for boundary in BOUNDARIES) + (not now > before)
        for now, before in zip(u, [u[0], *u[:-1]], strict=True)
    ]
    active = [motion.sections[number] for number in numbers]
    drive = [section.p3 * now for section, now in zip(active, u, strict=True)]
    return numbers, stepped([(section.p1, section.p2) for section in active], drive, STARTS[start])


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['model']}-{row['printed_section']}")
def test_every_published_row_is_stable_and_filters_as_a_loop_does(row):
    p1, p2, p3 = coefficients(row)
    matrix = np.array([[0.0, 1.0], [p1, p2]])
    assert np.abs(np.linalg.eigvals(matrix)).max() < 0.8895
    u = sine()
    np.testing.assert_allclose(response(p1, p2, p3 * u), looped(u, (p1, p2, p3)), atol=1e-12)


def test_poles_and_gains_of_the_published_rows():
    sections = [section for model in MODELS for section in published(model).sections]
    assert len(sections) == 21
    assert max(section.radius for section in sections) == pytest.approx(0.889, abs=5e-4)
    assert 5 * published("linear").sections[0].gain == pytest.approx(10.67, abs=5e-3)


@pytest.mark.parametrize("start", [REST, ZERO])
def test_switching_takes_one_of_parallel_sections_or_hands_one_state_on(start):
    """The section that holds drives the carried state; nothing is joined."""
    hard, u = replace(published("piecewise_inflate_deflate"), start=start), sine(480, 0.5, 5.0)
    parallel = np.array([looped(u, (s.p1, s.p2, s.p3), STARTS[start]) for s in hard.sections])
    numbers, carried = switched(hard, u, start)
    np.testing.assert_allclose(run(hard, u), parallel[numbers, np.arange(480)], atol=1e-12)
    np.testing.assert_allclose(run(replace(hard, switching=CARRIED), u), carried, atol=1e-12)


def test_steady_outputs_of_published_sections_disagree_by_up_to_one_and_a_half_centimetres():
    sections = published("piecewise").sections
    jumps = [
        abs(edge * (right.gain - left.gain))
        for edge, left, right in zip(BOUNDARIES, sections, sections[1:], strict=False)
    ]
    assert 1.0 < max(jumps) < 1.6


@pytest.mark.parametrize("model", ["piecewise", "piecewise_inflate_deflate"])
@pytest.mark.parametrize("rate", [0.05, -0.05])
def test_a_slow_ramp_over_a_boundary_jumps_hard_and_never_with_a_shared_state(model, rate):
    u = np.arange(0.0, 5.0, abs(rate) * STEP)[:: 1 if rate > 0 else -1]
    hard = published(model)
    moving = slice(20, None)  # the direction is known, and the first section has settled
    jump = np.abs(np.diff(run(hard, u))[moving]).max()
    smooth = np.abs(np.diff(run(continued(hard), u))[moving]).max()
    assert jump > 0.4
    assert smooth < 0.05


@given(st.lists(st.tuples(reflected, reflected), min_size=2, max_size=4), st.integers(0, 2**32 - 1))
def test_a_shared_state_is_handed_on(reflections, seed):
    rng = np.random.default_rng(seed)
    pairs = np.array([of_angles(np.arctanh(one), 0.98) for one in reflections])
    drive, holds = rng.standard_normal(60), np.repeat(rng.integers(0, len(reflections), 12), 5)
    expected = stepped(pairs[holds], drive)
    scale = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(shared(pairs, drive, holds), expected, atol=1e-9 * scale)
    columns = shared(pairs, np.column_stack([drive, 2 * drive]), holds)
    np.testing.assert_allclose(columns[:, 1], 2 * columns[:, 0], atol=1e-9 * scale)


@given(reflected, reflected, st.floats(0.3, 1.0))
def test_reflections_are_all_sections_within_reach(k1, k2, reach):
    p1, p2 = of_angles(np.arctanh([k1, k2]), reach)
    assert abs(poles(p1, p2)[0]) <= reach * (1 + 1e-6)
    again = of_angles(np.array(angles(p1, p2, reach)), reach)
    assert again == pytest.approx((p1, p2), abs=1e-6)


@given(st.floats(-1.5, 1.5), st.floats(-2.5, 2.5))
def test_the_triangle_is_where_both_poles_are_within_the_circle(p1, p2):
    largest = np.abs(np.linalg.eigvals([[0.0, 1.0], [p1, p2]])).max()
    if abs(largest - 1) > 1e-9:
        assert stable(p1, p2) == (largest < 1)
    assert abs(poles(p1, p2)[0]) == pytest.approx(largest, abs=1e-7)


def test_poles_on_the_circle_are_not_stable():
    for p1, p2 in ((-1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.0, -1.0)):
        assert not stable(p1, p2)
    assert poles(-0.25, 0.0) == (0.5j, -0.5j)  # of equal ones, the positive frequency comes first


def test_direction_is_literal_or_latched():
    u = np.array([0.0, 0.0, 1.0, 1.0, 0.95, 0.93, 1.1, 0.5, 0.5])
    assert rising(u, 0.0, latched=False).tolist() == [
        False,
        False,
        True,
        False,
        False,
        False,
        True,
        False,
        False,
    ]
    assert rising(u, 0.1, latched=True).tolist() == [
        True,
        True,
        True,
        True,
        True,
        True,
        True,
        False,
        False,
    ]


def test_sections_begin_at_their_lower_boundary():
    motion = published("piecewise")
    assert active(motion, np.array([0.0, 1.05, 1.049, 4.75, 9.0, -1.0])).tolist() == [
        0,
        1,
        0,
        5,
        5,
        0,
    ]


def test_sections_are_spread_by_equal_shares():
    assert spread(np.linspace(0, 6, 601), 3) == pytest.approx((2.0, 4.0))
    with pytest.raises(DataError, match="stays at 1"):
        spread(np.array([0.0, 1.0, 1.0, 1.0, 1.0, 1.0]), 4)


def test_each_piece_begins_at_rest():
    motion, u = published("linear"), sine(100)
    time = STEP * np.arange(100)
    time[60:] += 3.0
    values = simulate(motion, {"time": time, "input": u})
    np.testing.assert_allclose(
        values, np.concatenate([run(motion, u[:60]), run(motion, u[60:])]), atol=1e-12
    )
    assert values[60] == pytest.approx(u[60] * motion.sections[0].gain)


@pytest.mark.parametrize("name", MODELS)
def test_a_model_has_a_section_for_each_place_and_direction(name):
    motion = published(name)
    for changed, count in ((motion, 0), (replace(motion, sections=motion.sections[1:]), 1)):
        model = Model("a", Quantity("y", "mm"), (), StateSpace(changed, ()))
        assert len([*verbs_of(model).faults(model)]) == count


def test_a_run_starts_again_after_an_unknown_input():
    motion, u = published("linear"), sine(60)
    u[[20, 22]] = np.nan
    model = Model("a", Quantity("y", "mm"), (Quantity("input", "V"),), StateSpace(motion, ()))
    found = predict(model, {"input": u})
    parts = [run(motion, part) for part in (u[:20], u[21:22], u[23:])]
    expected = np.concatenate([parts[0], [np.nan], parts[1], [np.nan], parts[2]])
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert predict(model, {"input": np.empty(0)}).shape == (0,)


def test_another_time_step_is_refused():
    with pytest.raises(AtSample, match=r"even steps of 0\.05 s"):
        simulate(published("linear"), {"time": 0.01 * np.arange(20), "input": np.arange(20.0)})


@pytest.mark.parametrize("switching", ["hard", BUMPLESS])
def test_an_unstable_section_is_refused_by_name(switching):
    motion = published("piecewise") if switching == "hard" else continued(published("piecewise"))
    sections = list(motion.sections)
    sections[2] = replace(sections[2], p1=0.9, p2=0.3)
    broken = replace(motion, sections=tuple(sections))
    with pytest.raises(FitError, match=r"section 3 .* unstable: it has a pole at 1\.\d+") as raised:
        run(broken, sine())
    assert raised.value.remedy


def test_a_load_moves_only_what_depends_on_it():
    motion = published("linear")
    section = replace(motion.sections[0], weights=np.array([0.5, 0.1, -0.02, -0.01]))
    loaded = replace(motion, drives=("input", "1", "load", "input*load"), sections=(section,))
    u = sine()
    columns = {"time": STEP * np.arange(len(u)), "input": u, "load": np.full(len(u), 5.0)}
    expected = looped(0.5 * u + 0.1 - 0.02 * 5 - 0.01 * 5 * u, (section.p1, section.p2, 1.0))
    np.testing.assert_allclose(simulate(loaded, columns), expected, atol=1e-12)


@given(st.integers(5, 40), st.integers(2, 5), st.integers(0, 30), st.integers(0, 2**31))
def test_the_last_wavelength_is_where_an_input_repeats_itself(length, times, rest, seed):
    wave = np.random.default_rng(seed).standard_normal(length)
    u = np.concatenate([np.zeros(rest), np.tile(wave, times)])
    assert last_wavelength(u) == length


@pytest.mark.parametrize(
    "u",
    [np.arange(50.0), np.zeros(50), np.array([1.0]), np.random.default_rng(1).standard_normal(60)],
)
def test_without_repetition_it_is_the_whole_record(u):
    assert last_wavelength(u) == len(u)


def test_errors_are_those_of_the_last_wavelength():
    n, length = 240, 80
    u = np.sin(2 * np.pi * np.arange(n) / length)
    error = np.where(
        np.arange(n) < n - length, -3.0, -0.2 + 0.5 * np.sin(2 * np.pi * np.arange(n) / length)
    )
    measured = 2 * u
    found = motion_errors(measured, measured + error, u, STEP)
    tail = error[-length:]
    assert found.samples == length
    assert found.displacement_rmse == pytest.approx(math.sqrt(sum(e * e for e in tail) / length))
    assert found.max_displacement == pytest.approx(max(abs(e) for e in tail))
    assert found.transient == pytest.approx(3.0)
    slopes = [(error[k + 1] - error[k - 1]) / (2 * STEP) for k in range(n - length + 1, n - 1)]
    assert found.max_velocity >= max(abs(slope) for slope in slopes) - 1e-12


def test_inputs_are_the_driving_one_and_what_drives_beside_it_by_their_names():
    motion = replace(published("linear"), drives=("load*input", "1", "zeal + air*bend"))
    assert motion_inputs(motion) == ["input", "air", "bend", "load", "zeal"]


@pytest.mark.parametrize(("name", "count"), [("linear", 3), ("inflate_deflate", 6)])
def test_a_section_has_two_poles_and_its_weights(name, count):
    model = Model("a", Quantity("y", "mm"), (), StateSpace(published(name), ()))
    assert parameters(model) == count
    assert runs_over_time(model)
