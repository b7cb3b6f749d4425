"""Muscles and shipped simulations that the tests of the rig share."""

from functools import cache
from pathlib import Path

import pytest

from datasets.rig.muscle import Hysteresis, Stop
from datasets.rig.simulate import SimulationSpec
from datasets.rig.static_muscles import McKibben, Peano
from mapmore_cli.study.loader import load_as

DATASETS = Path(__file__).parents[2] / "datasets"
BRAID, TUBES = McKibben(kind="mckibben"), Peano(kind="peano")
MUSCLES = {"mckibben": BRAID, "peano": TUBES}
both = pytest.mark.parametrize("kind", list(MUSCLES))


@cache
def spec(path, *changes):
    """A shipped simulation, `mckibben/load_cycles`, with changes."""
    return load_as(DATASETS / f"{path}.yaml", SimulationSpec, changes).spec


def friction(base, per_pressure, yields, shares):
    """Friction of such stops; N, N/Pa."""
    return Hysteresis(
        base, per_pressure, [Stop(*stop) for stop in zip(yields, shares, strict=True)]
    )
