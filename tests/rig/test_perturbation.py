from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mapmore_cli.rig.load_cycle import Strokes, perturbation
from mapmore_cli.rig.sensors import low_pass
from mapmore_cli.spec.loader import load_as
from mapmore_cli.spec.simulation import SimulationSpec
from mapmore_cli.study.simulate import wet_muscle_of

DATASETS = Path(__file__).parents[2] / "datasets"
STROKES = Strokes(stretched=0.2, contracted=0.8, moves=(1.0, 0.3), dwell=0.25, sample_time=0.001)
both = pytest.mark.parametrize("kind", ["mckibben", "peano"])


@cache
def muscle(kind):
    spec = load_as(DATASETS / kind / "perturbations.yaml", SimulationSpec).spec
    return wet_muscle_of(spec, spec.experiment.rig)


@cache
def truth(kind):
    return perturbation(muscle(kind), STROKES, 350e3, 40.0)


def test_each_move_and_rest_has_its_duration():
    times, strains = STROKES.corners(0.2)
    np.testing.assert_allclose(np.diff(times), [0.25, 1.0, 0.25, 1.0, 0.25, 0.3, 0.25, 0.3, 0.25])
    np.testing.assert_allclose(strains, np.repeat([0.16, 0.04, 0.16, 0.04, 0.16], 2))


@both
def test_the_actuator_rests_at_its_ends_and_stays_between(kind):
    strain = truth(kind)["strain"]
    assert len(strain) == 3850
    assert np.ptp(strain[:250]) == 0
    assert strain.min() == pytest.approx(0.25 * strain.max())
    assert strain[1250:1500] == pytest.approx(strain.min())


@both
def test_a_slow_stroke_is_a_load_cycle(kind):
    """Slowly, what is left is the static force and at most the half-width of the friction."""
    slow = perturbation(muscle(kind), Strokes(0.2, 0.8, (3.0,), 0.3, 0.01), 350e3, 20.0)
    away = slow["force"] - muscle(kind).chamber.muscle.force(350e3, slow["strain"])
    assert np.abs(away).max() < float(muscle(kind).hysteresis.half_width(350e3)) * 1.1
    assert away[100:300].mean() > 0 > away[400:600].mean()


def test_the_amplifier_passes_slow_forces_and_halves_the_power_at_its_cut_off():
    time = 1e-3 * np.arange(4000)
    for frequency, gain in ((0.5, 1.0), (40.0, np.sqrt(0.5))):
        passed = low_pass(np.sin(2 * np.pi * frequency * time), 40.0, 1e-3)[2000:]
        assert passed.std() * np.sqrt(2) == pytest.approx(gain, rel=0.05)


def test_the_amplifier_neither_rings_nor_turns_a_pull_into_a_push():
    step = np.where(np.arange(200) < 100, 1000.0, 0.0)
    passed = low_pass(step, 40.0, 1e-3)
    assert passed[:100] == pytest.approx(1000.0)
    assert np.all(np.diff(passed) <= 1e-9)
    assert passed[-1] == pytest.approx(0.0, abs=1e-6)
    assert passed.min() >= -1e-9
