"""Load cycles and tables of contractions: what loops and balances must obey."""

import numpy as np
import pytest
from rig_cases import MUSCLES, both, friction, spec

from datasets.rig.load_cycle import (
    load_cycle,
    resting_strains,
)
from datasets.rig.muscle import zero_force_strain

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


def test_each_weight_hangs_where_the_muscle_balances_it():
    muscle, weights = spec("wrist/contraction_table").muscle, np.linspace(0.0, 290.0, 7)
    strains = resting_strains(muscle, friction(0.0, 0.0, [0.01], [1.0]), 4e5, weights)
    assert muscle.force(4e5, strains) == pytest.approx(weights, abs=1e-6)
    assert (np.diff(strains) < 0).all()
