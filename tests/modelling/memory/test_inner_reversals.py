"""Simulated load cycles with inner reversals, at amplitudes that training did not have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from memory_samples import nrmse_by_range, recipe_of, record

from mapmore_cli.modelling.expressions import to_text
from mapmore_cli.modelling.expressions.families import operated, products
from mapmore_cli.modelling.expressions.operators.play import spread_widths
from mapmore_cli.modelling.memory.fitting import fit_with_memory
from mapmore_cli.modelling.memory.free_run import free_run
from mapmore_cli.rig.muscle import Hysteresis
from mapmore_cli.spec.muscle_rigs import McKibbenMuscle, PeanoMuscle
from mapmore_cli.study.simulate import muscle_of

MUSCLES = {"mckibben": (muscle_of(McKibbenMuscle(kind="mckibben")), 0.2), "peano": (muscle_of(PeanoMuscle(kind="peano")), 0.27)}
FRICTION = Hysteresis(base=3.0, per_pressure=6e-5, yield_strains=np.array([0.002, 0.01, 0.04]), shares=np.array([0.3, 0.4, 0.3]))
STEP = 0.05


def cycled(muscle, corners, seed, noise=0.5):
    """Strain through `corners` at constant rate, and the force of the muscle at 350 kPa with its friction."""
    corners = np.array(corners)
    path = np.interp(np.arange(0, 1, 1 / 3000), np.r_[0, np.cumsum(np.abs(np.diff(corners)))] / np.abs(np.diff(corners)).sum(), corners)
    force = muscle.force(350e3, path) - FRICTION.force(350e3, path) + noise * np.random.default_rng(seed).normal(size=len(path))
    return record(strain=path, force=force)


@pytest.mark.parametrize("kind", MUSCLES)
def test_operators_follow_inner_reversals_of_new_amplitudes(kind):
    muscle, stroke = MUSCLES[kind]
    training = cycled(muscle, stroke * np.array([0, 1, 0, 0.7, 0.3, 1, 0.6, 0.9, 0]), 1)
    validation = cycled(muscle, stroke * np.array([0, 0.8, 0.15, 0.55, 0.4, 0.95, 0.1, 0.5, 0.2, 0.3, 0]), 2)
    widths = (0.01, 0.02, 0.05, *spread_widths(4))
    plays = operated("play", ["strain"], widths)
    powers = tuple(to_text(term) for term in products(["strain"], 5, constant=False))
    recipe = recipe_of("force", powers, STEP, scaling="range", ridge=1e-6, max_terms=12, forward=24)
    dictionaries = {
        "static": powers,
        "prandtl_ishlinskii": ("strain", *plays),
        "static and operators": (*powers, *operated("stop", ["strain"], widths), *plays),
    }
    error = {}
    for name, dictionary in dictionaries.items():
        model = fit_with_memory([training], replace(recipe, dictionary=dictionary)).model
        columns = validation.columns
        error[name] = nrmse_by_range(columns["force"], free_run(model, columns).values)
    assert error["static and operators"] < 0.5 * error["static"]
    assert error["static and operators"] < 0.5 * error["prandtl_ishlinskii"]
