"""Load cycles and tables of contractions: what loops and balances must obey."""

import numpy as np
import pytest
from rig_cases import MUSCLES, both, friction, spec

from datasets.rig.load_cycle import (
    load_cycle,
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
