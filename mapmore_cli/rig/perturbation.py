"""Perturbation at constant pressure, the experiment that M2 section 6.2 asks for (after Cao et al., its reference 49).

A regulator holds the reservoir's pressure while an actuator stretches the muscle and lets it contract again, each time faster.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.rig.muscle import zero_force_strain
from mapmore_cli.rig.sensors import observe
from mapmore_cli.rig.wet_muscle import TOLERANCE, WetMuscle, integrate


@dataclass(frozen=True)
class Strokes:
    """How the actuator moves: from the contracted to the stretched end and back, smoothly, with rests between."""

    stretched: float  # strain at this end, as a fraction of the free strain
    contracted: float
    moves: tuple[float, ...]  # duration of each stretch and of the release after it, s
    dwell: float  # rest before, between and after the moves, s
    sample_time: float  # s

    def corners(self, free: float) -> tuple[Array, Array]:
        """Times (s) and strains, `(4 m + 2,)` for m moves, at which rests begin and end; `free` is the free strain."""
        spans = [self.dwell, *(span for move in self.moves for span in (move, self.dwell, move, self.dwell))]
        ends = np.resize([free * self.contracted, free * self.stretched], 2 * len(self.moves) + 1)
        return np.cumsum([0.0, *spans]), np.repeat(ends, 2)


def perturbation(muscle: WetMuscle, strokes: Strokes, pressure: float, cut_off: float, tolerance: float = TOLERANCE) -> Columns:
    """Truth of one recording, columns `(n,)` as those of `observe`, at a constant `pressure` (Pa) of the reservoir.

    It begins with still water, and with friction and rubber relaxed.
    """
    free = zero_force_strain(lambda strain: muscle.chamber.respond(pressure, strain).tension)
    times, ends = strokes.corners(free)
    strain = CubicHermiteSpline(times, ends, np.zeros_like(ends))
    strain_rate = strain.derivative()

    def rates(time: float, states: Array) -> Array:
        return muscle.respond(states, pressure, float(strain(time)), float(strain_rate(time)))[1]

    clock = strokes.sample_time * np.arange(round(times[-1] / strokes.sample_time))
    wet = integrate(rates, muscle.at_rest(pressure), clock, muscle.scales, tolerance)
    return observe(muscle, clock, np.asarray(strain(clock)), wet, cut_off)
