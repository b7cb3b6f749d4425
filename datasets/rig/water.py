"""A muscle at the end of M2's water line: reservoir, line, pressure sensor, tube, muscle (M2
section 4.1 and 6.3).

The sensor sits before the tube. What M2 calls damping force is for the most part what the tube's
flow takes from the pressure on its way to the muscle.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from datasets.rig.air import ATMOSPHERE
from datasets.rig.marks import NonNegative, Positive
from datasets.rig.muscle import IN_KPA, SLACK_WIDTH, MovingMuscle, Rubber, softplus
from datasets.rig.sensors import low_pass
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import Settings

DrivingPressure = Annotated[float, Interval(gt=0, le=1000), IN_KPA]
"""That fills a muscle with water; gauge, Pa."""

WATER_DENSITY = 998.0
"""kg/m3."""

WATER_VISCOSITY = 1.0e-3
"""Dynamic, Pa s."""

BLASIUS_REYNOLDS = (64.0 / 0.316) ** (4.0 / 3.0)
"""Reynolds number (1187) at which laminar `64/Re` and Blasius' `0.316 Re^-0.25` give the same
friction factor.
"""


@dataclass(frozen=True)
class Pipe(Settings):
    """A full, rigid, round pipe."""

    length: Positive  # m
    diameter: Positive  # m
    loss: NonNegative  # K of its entry, bends and fittings together

    @property
    def area(self) -> float:
        """Cross-section A, m2."""
        return 0.25 * pi * self.diameter**2

    @property
    def inertance(self) -> float:
        """`I = rho L/A`, Pa s2/m3."""
        return WATER_DENSITY * self.length / self.area

    def drop(self, flow: float) -> float:
        """Pressure lost to a steady `flow` (m3/s), Pa, of its sign: `R Q (1 + (Re/1187)^3)^(1/4) +
        K rho u |u|/2`.

        `R = 128 mu L/(pi d^4)` is the laminar resistance; the bracket blends into Blasius' law,
        `Re^(3/4)` as large.
        """
        speed = flow / self.area
        reynolds = WATER_DENSITY * abs(speed) * self.diameter / WATER_VISCOSITY
        laminar = 128.0 * WATER_VISCOSITY * self.length / (pi * self.diameter**4) * flow
        friction = laminar * sqrt(sqrt(1.0 + (reynolds / BLASIUS_REYNOLDS) ** 3))
        return friction + 0.5 * self.loss * WATER_DENSITY * speed * abs(speed)


@dataclass(frozen=True)
class Wall(Settings):
    """Soft wall of hose or muscle: it bulges by a volume W, late; `P = (W + tau W')/C` (Kelvin and
    Voigt).
    """

    compliance: Positive  # C, m3/Pa
    relaxation_time: Positive  # tau, s

    def pressure(self, bulge: float, growth: float) -> float:
        """P, Pa, at W (m3) and W' (m3/s)."""
        return (bulge + self.relaxation_time * growth) / self.compliance

    def growth(self, bulge: float, pressure: float) -> float:
        """W', m3/s, at W (m3) and P (Pa)."""
        return (self.compliance * pressure - bulge) / self.relaxation_time


@dataclass(frozen=True)
class WaterRig(Settings):
    """From the reservoir to the load cell."""

    line: Pipe  # reservoir to pressure sensor
    hose: Wall  # of the line, where the sensor sits
    tube: Pipe  # sensor to muscle
    trapped_air: Positive  # in the muscle, m3 at no gauge pressure
    wall: Wall  # of the muscle
    rubber: Rubber
    load_cell: Positive  # cut-off of its amplifier, Hz


def bubble_compliance(volume: float, pressure: float) -> float:
    """`-dV/dP = V0 p0/(P + p0)^2`, m3/Pa, of air trapped in water: `volume` V0 at no gauge
    `pressure`, isothermal.
    """
    return volume * ATMOSPHERE / (pressure + ATMOSPHERE) ** 2


class Water(NamedTuple):
    """State of water and walls; the losses follow it."""

    line_flow: float  # Q1, m3/s
    hose: float  # W1, m3
    tube_flow: float  # Q2, m3/s
    pressure: float  # Pm in the muscle, Pa
    bulge: float  # W of the muscle's wall, m3


WATER_SCALES = Water(1e-4, 1e-7, 1e-4, 1e5, 1e-7)
"""Size of each, for the tolerance of the integration."""

LOSSES = len(WATER_SCALES)
"""Where the losses begin."""


@dataclass(frozen=True)
class WetMuscle(MovingMuscle):
    """A muscle, its losses and the water that drives it; `(k,)` states: `Water`, then the
    losses.
    """

    rig: WaterRig

    @property
    def scales(self) -> Array:
        """Size of each state, `(k,)`."""
        return np.concatenate([WATER_SCALES, self.scales_of_losses])

    def at_rest(self, pressure: float) -> Array:
        """States `(k,)` of still water at `pressure` (Pa), with relaxed friction and rubber."""
        water = Water(
            0.0,
            self.rig.hose.compliance * pressure,
            0.0,
            pressure,
            self.rig.wall.compliance * pressure,
        )
        return np.concatenate([water, self.relaxed])

    def sensor_pressure(self, water: Water) -> float:
        """P1, Pa, in the hose between line and tube."""
        return self.rig.hose.pressure(water.hose, water.line_flow - water.tube_flow)

    def respond(
        self, states: Array, source: float, strain: float, strain_rate: float
    ) -> tuple[float, Array]:
        """Pull (N) and rates `(k,)` of the states behind a `source` pressure (Pa), at `strain`,
        moving at `strain_rate` (1/s).

        `I1 Q1' = P_a - P1 - dp1(Q1)`, `W1' = Q1 - Q2`, `I2 Q2' = P1 - Pm - dp2(Q2)`, `(dV/dP +
        C_air) Pm' = Q2 - V_e e' - W'`; pull `softplus(tension - friction - s)`, all at the pressure
        in the muscle.
        """
        water, losses, rig = Water(*states[:LOSSES].tolist()), states[LOSSES:], self.rig
        muscle = self.muscle.respond(water.pressure, strain)
        sensor = self.sensor_pressure(water)
        growth = rig.wall.growth(water.bulge, water.pressure)
        compliance = muscle.filling + bubble_compliance(rig.trapped_air, water.pressure)
        changes = Water(
            line_flow=(source - sensor - rig.line.drop(water.line_flow)) / rig.line.inertance,
            hose=water.line_flow - water.tube_flow,
            tube_flow=(sensor - water.pressure - rig.tube.drop(water.tube_flow))
            / rig.tube.inertance,
            pressure=(water.tube_flow - muscle.displacement * strain_rate - growth) / compliance,
            bulge=growth,
        )
        pull = float(softplus(self.left_of(muscle.tension, losses, water.pressure), SLACK_WIDTH))
        return pull, np.concatenate([changes, self.rates_of_losses(losses, strain_rate)])


def observe(muscle: WetMuscle, time: Array, strain: Array, wet: Array) -> Columns:
    """Columns `(n,)` along the muscle's states `wet` `(n, k)`, evenly spaced in time.

    `time` (s), `pressure` at the sensor before the tube (Pa), `strain`, `force` behind the load
    cell's amplifier (N), `flow` through the tube (m3/s, positive towards the muscle),
    `muscle_pressure` in the muscle (Pa).
    """
    pull = np.array(
        [
            muscle.respond(states, 0.0, at, 0.0)[0]
            for states, at in zip(wet, strain.tolist(), strict=True)
        ]
    )
    water = Water(*wet.T[:LOSSES])
    return {
        "time": time,
        "pressure": np.asarray(muscle.sensor_pressure(water)),
        "strain": strain,
        "force": low_pass(pull, muscle.rig.load_cell, float(time[1] - time[0])),
        "flow": np.asarray(water.tube_flow),
        "muscle_pressure": np.asarray(water.pressure),
    }
