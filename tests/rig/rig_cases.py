"""Muscles and shipped simulations that the tests of the rig share."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from mapmore_cli.spec.loader import load_as
from mapmore_cli.spec.simulation import McKibbenMuscle, PeanoMuscle, SimulationSpec
from mapmore_cli.study.simulation.simulate import muscle_of

DATASETS = Path(__file__).parents[2] / "datasets"
BRAID, TUBES = muscle_of(McKibbenMuscle(kind="mckibben")), muscle_of(PeanoMuscle(kind="peano"))
MUSCLES = {"mckibben": BRAID, "peano": TUBES}
both = pytest.mark.parametrize("kind", list(MUSCLES))


@cache
def spec(path: str, *changes: str) -> SimulationSpec:
    """A shipped simulation, `mckibben/load_cycles`, with changes."""
    return load_as(DATASETS / f"{path}.yaml", SimulationSpec, changes).spec
