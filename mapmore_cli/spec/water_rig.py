"""The parts of M2's rig (its figure 8) as a simulation's spec names them; in SI units: m, s, N, m3, m3/Pa, m3/(s Pa)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from mapmore_cli.spec.fields import Positive, Section

NonNegative = Annotated[float, Field(ge=0)]


class PipeSpec(Section):
    """A round pipe full of water."""

    length: Positive  # m
    diameter: Positive  # m
    loss: NonNegative  # K of entry, bends and fittings


class WallSpec(Section):
    """A soft wall that bulges late."""

    compliance: Positive  # m3/Pa
    relaxation_time: Positive  # s


class RubberSpec(Section):
    """A Maxwell element beside the muscle."""

    stiffness: NonNegative  # N per strain
    relaxation_time: Positive  # s


class WaterRig(Section):
    """From the reservoir to the load cell (see `mapmore_cli.rig.wet_muscle`)."""

    line: PipeSpec  # reservoir to pressure sensor
    hose: WallSpec  # of the line, where the sensor sits
    tube: PipeSpec  # sensor to muscle
    trapped_air: Positive  # in the muscle, m3 at no gauge pressure
    wall: WallSpec  # of the muscle
    rubber: RubberSpec
    load_cell: Positive  # cut-off of its amplifier, Hz


class ReservoirSpec(Section):
    """Bottle of water under air, between a supply and an exhaust valve by ISO 6358."""

    air_volume: Positive  # m3
    polytropic: Annotated[float, Field(ge=1, le=1.4)]
    supply_conductance: Positive  # m3/(s Pa)
    exhaust_conductance: Positive
    critical_ratio: Annotated[float, Field(ge=0, lt=0.99)]


class BumperSpec(Section):
    """The stop on which the weight rests."""

    stiffness: Positive  # N/m
    damping: NonNegative  # s/m
    pretension: Positive  # of the muscle, N
