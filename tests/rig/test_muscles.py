"""The synthetic muscles against published numbers, their own geometry and common sense; their
friction.
"""

import pytest
from rig_cases import MUSCLES, both

from datasets.rig.muscle import (
    zero_force_strain,
)

PUBLISHED = {  # kPa, force at zero strain N, free strain
    "mckibben": ((80, 215, 0.036), (150, 445, 0.104), (250, 735, 0.181), (350, 1002, 0.221)),
    "peano": ((80, 227, 0.155), (200, 422, 0.234), (350, 605, 0.274), (500, 756, 0.295)),
}


def free_strain(muscle, pressure):
    return zero_force_strain(lambda strain: float(muscle.force(pressure, strain)))


@both
def test_the_documented_forces_free_strains_and_lengths(kind):
    muscle = MUSCLES[kind]
    assert muscle.length == pytest.approx({"mckibben": 0.088, "peano": 0.069}[kind])
    for kpa, force, strain in PUBLISHED[kind]:
        assert float(muscle.force(kpa * 1e3, 0.0)) == pytest.approx(force, rel=0.005)  # asked: 0.05
        assert free_strain(muscle, kpa * 1e3) == pytest.approx(strain, abs=6e-4)
