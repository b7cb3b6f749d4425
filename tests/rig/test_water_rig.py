"""Water, air and stop against their laws; step responses and strokes against what M2 says of its
data.
"""

from functools import cache

import numpy as np
import pytest
from rig_cases import BRAID, MUSCLES, both, spec
from scipy.integrate import quad, trapezoid
from scipy.signal import find_peaks

from datasets.rig.air import ATMOSPHERE
from datasets.rig.static_muscles import volume
from datasets.rig.step_response import PressureStep, step_response
from datasets.rig.water import (
    WATER_DENSITY,
    WATER_VISCOSITY,
    Pipe,
    WetMuscle,
)

TUBE = Pipe(length=0.5, diameter=0.0045, loss=0.0)


def flow_at(reynolds):
    return reynolds * WATER_VISCOSITY * TUBE.area / (WATER_DENSITY * TUBE.diameter)


@pytest.mark.parametrize(
    ("reynolds", "friction_factor"),
    [(10, 64 / 10), (200, 64 / 200), (2e4, 0.316 * 2e4**-0.25), (1e5, 0.316 * 1e5**-0.25)],
)
def test_friction_is_poiseuilles_and_blasius(reynolds, friction_factor):
    speed = flow_at(reynolds) / TUBE.area
    expected = friction_factor * TUBE.length / TUBE.diameter * 0.5 * WATER_DENSITY * speed**2
    assert TUBE.drop(flow_at(reynolds)) == pytest.approx(expected, rel=2e-3)


VALIDATION = {"mckibben": 250e3, "peano": 350e3}  # Pa, of 115 N
WEIGHT = 115.0


def wet_muscle(found):
    return WetMuscle(
        found.muscle, found.hysteresis, found.experiment.rig.rubber, found.experiment.rig
    )


@cache
def rig(kind, *changes):
    found = spec(f"{kind}/step_responses", *changes)
    return found.experiment, wet_muscle(found)


@cache
def response(kind):
    return step_response(*rig(kind), PressureStep(VALIDATION[kind], WEIGHT))


def swollen(kind, pressure, strain):
    """Water in muscle, wall and bubble, m3, less a constant."""
    wet, muscle = rig(kind)[1], MUSCLES[kind]
    if muscle is BRAID:
        inside = float(volume(muscle, np.asarray(strain)))
    else:
        inside = quad(
            lambda p: muscle.respond(p, strain).filling,
            0,
            pressure,
            points=[1, 30, 1e3, 1e4],
            limit=500,
        )[0]
        inside += quad(
            lambda e: muscle.respond(0.0, e).displacement,
            -1e-3,
            strain,
            points=[0.0, 1e-3],
            limit=500,
        )[0]
    bubble = wet.rig.trapped_air * ATMOSPHERE / (ATMOSPHERE + pressure)
    return inside + wet.rig.wall.compliance * pressure - bubble


@both
def test_water_is_conserved(kind):
    """All that came through the tube until the plateau is in the muscle."""
    truth = response(kind)
    end = 2590
    came = trapezoid(truth["flow"][: end + 1], truth["time"][: end + 1])
    there = swollen(kind, truth["muscle_pressure"][end], truth["strain"][end]) - swollen(
        kind, 0.0, truth["strain"][0]
    )
    assert came > 5e-6
    assert there == pytest.approx(came, rel=5e-3)


def test_the_mckibben_rings_as_slowly_as_measured():
    """M2 section 5.3: 3.4 Hz on the plateau at 250 kPa."""
    strain = response("mckibben")["strain"][600:2400]
    peaks, _ = find_peaks(strain, prominence=5e-5)
    assert len(peaks) >= 3
    assert 1.0 / (1e-3 * np.diff(peaks).mean()) == pytest.approx(3.4, rel=0.15)
