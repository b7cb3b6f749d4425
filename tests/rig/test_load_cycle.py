"""Load cycles and tables of contractions: what loops and balances must obey."""

from dataclasses import replace

import numpy as np
import pytest
from rig_cases import MUSCLES, both, friction, spec

from datasets.rig.load_cycle import (
    load_cycle,
    resting_strains,
    strain_path,
)
from datasets.rig.muscle import zero_force_strain
from datasets.rig.simulate import recording
from mapmore_cli.domain.errors import SpecError

FRICTION = friction(3.0, 3e-5, (0.001, 0.01), (0.5, 0.5))
CYCLE = spec("mckibben/load_cycles", "experiment.regulation.ripple=0").experiment


def run(kind, kpa, cycle=CYCLE):
    return load_cycle(MUSCLES[kind], FRICTION, cycle, kpa * 1e3, np.random.default_rng(1))


@both
@pytest.mark.parametrize("kpa", [80, 350])
def test_one_loop_from_lock_to_zero_force_and_back(kind, kpa):
    truth = run(kind, kpa)
    time, strain, force = truth["time"], truth["strain"], truth["force"]
    assert len(time) == 2501
    assert strain[0] == strain[-1] == 0.0
    turn = int(np.argmax(strain))
    assert np.all(np.diff(strain[: turn + 1]) >= 0)
    assert np.all(np.diff(strain[turn:]) <= 0)
    free = zero_force_strain(lambda e: float(MUSCLES[kind].force(kpa * 1e3, e)))
    assert 0.8 * free < strain[turn] < free
    assert 0 <= force[turn] < 0.5
    assert force[0] == pytest.approx(float(MUSCLES[kind].force(kpa * 1e3, 0.0)), rel=1e-9)


@both
def test_extension_lies_above_contraction_by_twice_the_half_width(kind):
    truth = run(kind, 350)
    turn = int(np.argmax(truth["strain"]))
    middle = 0.5 * truth["strain"][turn]
    contracting = np.interp(middle, truth["strain"][:turn], truth["force"][:turn])
    extending = np.interp(middle, truth["strain"][turn:][::-1], truth["force"][turn:][::-1])
    assert extending - contracting == pytest.approx(2 * (3.0 + 3e-5 * 350e3), rel=1e-3)


INNER = replace(CYCLE, duration=125.0, turns=(1.0, 0.3, 0.7, 0.0, 0.6))


def test_the_actuator_turns_where_it_is_told_and_moves_at_one_speed():
    time = 0.001 * np.arange(125_001)
    strain = strain_path(INNER, 0.2, time)
    moving = np.flatnonzero(np.diff(strain) != 0)
    rates = np.abs(np.diff(strain)[moving]) / 0.001
    assert np.quantile(rates, [0.01, 0.99]) == pytest.approx(
        2 * [2 * 4.0 * 0.2 / (2 * (125 - 7 * 0.5))], rel=1e-3
    )
    pauses = np.flatnonzero(np.diff(moving) > 1)
    np.testing.assert_allclose(strain[moving[pauses] + 1] / 0.2, INNER.turns, atol=1e-9)
    assert np.diff(moving)[pauses] * 0.001 == pytest.approx([0.5] * 5, abs=2e-3)
    assert (time[moving[0]], time[moving[-1]]) == pytest.approx((0.5, 124.5), abs=2e-3)


@both
def test_a_reversal_inside_the_loop_leaves_the_branch_and_comes_back_to_it(kind):
    """What stop operators do: the inner loop closes, and the outer branch goes on as if nothing had
    been (Madelung).
    """
    inner, outer = run(kind, 350, INNER), run(kind, 350)
    turn = int(np.argmax(inner["strain"]))
    falling = slice(turn, turn + int(np.argmin(inner["strain"][turn : turn + 2000])))
    stroke = inner["strain"].max()
    # the end of the inner rise; the fall to zero follows
    last = int(np.flatnonzero(inner["strain"] > 0.69 * stroke)[-1])
    fall = slice(last, last + int(np.argmin(inner["strain"][last:])))
    back = outer["strain"].argmax()
    for strains, branch in ((0.8, falling), (0.2, fall)):
        at = strains * stroke
        on_branch = np.interp(at, inner["strain"][branch][::-1], inner["force"][branch][::-1])
        on_outer = np.interp(at, outer["strain"][back:][::-1], outer["force"][back:][::-1])
        assert on_branch == pytest.approx(on_outer, abs=0.02)
    middle = 0.5 * stroke
    rise = slice(falling.stop, last)
    rising = np.interp(middle, inner["strain"][rise], inner["force"][rise])
    extending = np.interp(middle, outer["strain"][back:][::-1], outer["force"][back:][::-1])
    assert extending - rising > 5.0


def test_each_weight_hangs_where_the_muscle_balances_it():
    muscle, weights = spec("wrist/contraction_table").muscle, np.linspace(0.0, 290.0, 7)
    strains = resting_strains(muscle, friction(0.0, 0.0, [0.01], [1.0]), 4e5, weights)
    assert muscle.force(4e5, strains) == pytest.approx(weights, abs=1e-6)
    assert (np.diff(strains) < 0).all()


def test_repeats_are_averaged():
    """The mean of nine repeats scatters less around the weights' balance than one of them does."""
    single, many = (
        spec("wrist/contraction_table", f"experiment.repeats={n}", "experiment.regulator_error=0")
        for n in (1, 9)
    )
    exact = resting_strains(
        single.muscle, single.hysteresis, 6e5, 9.81 * np.array(single.experiment.masses)
    )
    one, nine = (np.std(recording(table, 6e5)["strain"] - exact) for table in (single, many))
    assert nine < 0.6 * one


def test_a_weight_that_nothing_balances_is_told():
    with pytest.raises(SpecError, match="does not vanish"):
        recording(spec("wrist/contraction_table", "experiment.masses=[1000]"), 1e5)
