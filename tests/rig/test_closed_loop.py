"""The muscle in a loop: what the rig keeps to."""

from __future__ import annotations

import numpy as np
import pytest

from mapmore_cli.rig.muscle import Hysteresis
from mapmore_cli.rig.waveform import GRAVITY, Lift, Loop, closed_loop, wanted_force

LIFT = Lift(mass=10.0, length=0.1, damping=300.0, lag=0.02, highest=4e5, step=1e-3)
NO_FRICTION = Hysteresis(0.0, 0.0, np.array([0.01]), np.array([1.0]))


class Spring:
    """`F = 1e-3 P - 1000 e`: 10 kg hang at rest where `P = 1e3 (98.1 + 1000 e)`."""

    def force(self, pressure: np.ndarray | float, strain: np.ndarray | float) -> np.ndarray:
        return np.asarray(1e-3 * np.asarray(pressure) - 1000.0 * np.asarray(strain))


def pressure_at_rest(strain: np.ndarray) -> np.ndarray:
    return 1e3 * (LIFT.mass * GRAVITY + 1000.0 * strain)


def test_the_right_pressure_keeps_it_at_rest() -> None:
    reference = np.full(200, 0.05)
    found = closed_loop(Spring(), NO_FRICTION, LIFT, Loop(5e-3, 0.0, 0.0), reference, pressure_at_rest(reference))
    assert found["strain"] == pytest.approx(reference, abs=1e-9)
    assert wanted_force(LIFT, reference, 5e-3) == pytest.approx(np.full(200, LIFT.mass * GRAVITY))


def test_the_loop_takes_a_wrong_pressure_off_and_the_command_stays_in_its_limits() -> None:
    reference = np.full(800, 0.05)
    wrong = pressure_at_rest(reference) + 3e4
    free, closed = (closed_loop(Spring(), NO_FRICTION, LIFT, loop, reference, wrong) for loop in (Loop(5e-3, 0, 0), Loop(5e-3, 2e5, 2e6)))
    assert free["strain"][-1] == pytest.approx(0.08, abs=1e-4)
    assert closed["strain"][-1] == pytest.approx(0.05, abs=1e-4)
    high = closed_loop(Spring(), NO_FRICTION, LIFT, Loop(5e-3, 1e8, 0.0), np.full(50, 0.5), pressure_at_rest(np.full(50, 0.1)))
    assert (high["command"].min() >= 0.0) & (high["command"].max() <= LIFT.highest)


def test_friction_holds_it_back() -> None:
    friction = Hysteresis(30.0, 0.0, np.array([0.002]), np.array([1.0]))
    reference = np.full(400, 0.05)
    pushed = pressure_at_rest(reference) + 2e4
    held = closed_loop(Spring(), friction, LIFT, Loop(5e-3, 0.0, 0.0), reference, pushed)["strain"][-1]
    assert 0.05 < held < 0.055
