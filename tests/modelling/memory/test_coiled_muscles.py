"""Motion of measured coiled muscles in free run, one setting for steps and loops; skipped where they are not installed."""

from __future__ import annotations

import numpy as np
import openpyxl
import pytest
from memory_samples import nrmse_by_range, recipe_of, record

from mapmore_cli.modelling.expressions import to_text
from mapmore_cli.modelling.expressions.families import operated, products
from mapmore_cli.modelling.memory.fitting import fit_with_memory
from mapmore_cli.modelling.memory.free_run import free_run
from mapmore_cli.modelling.signals.cycles import last_cycles
from mapmore_cli.modelling.signals.sampling import find_gaps, pieces, resample

STEP, GAP = 0.01, 0.1  # s
STATES = (
    "pressure",
    *operated("slow", ["pressure"], [0.1, 0.3, 1, 3]),
    *operated("resonance", ["pressure"]),
    *operated("play", ["pressure"], [0.04, 0.08, 0.16, 0.24, 0.32, 0.40, 0.46]),
    *operated("slow", operated("play", ["pressure"], [0.16, 0.32]), [0.3, 1]),
)
DICTIONARY = tuple(to_text(term) for term in products(STATES, 2, partners=["pressure"], constant=False))
SETTING = recipe_of("displacement", DICTIONARY, STEP, scaling="range", ridge=0.002, max_terms=12, forward=36)
STATIC = recipe_of("displacement", ("1", "pressure", "pressure^2", "pressure^3"), STEP, max_terms=4)
PLAYS = recipe_of("displacement", ("1", *STATES[:1], *operated("play", ["pressure"], np.linspace(0.04, 0.46, 10))), STEP, max_terms=12)

LOOPS = {  # seconds that were measured soundly: jumps of the position sensor lie outside
    "200grams_Sample_1_Test_1": (0, 60),
    "200grams_Sample_1_Test_2": (8.2, 60),
    "200grams_Sample_2_Test_1": (0, 60),
    "300grams_Sample_1_Test_1": (0, 67.1),
    "400grams_Sample_1_Test_1": (21.2, 46.5),
}
STEPS = ("Sample 1 Final 300 grams", "Sample 2 Final 300 grams")


def records(table, between=(-np.inf, np.inf)):
    """Pieces on even time steps, the last half of the cycles held out."""
    time, pressure, position = table[(table[:, 0] >= between[0]) & (table[:, 0] <= between[1])].T
    cut = pieces(len(time), find_gaps(time, GAP).after)
    even = [resample(time[rows], {"pressure": pressure[rows], "displacement": -position[rows]}, STEP) for rows in cut]
    held = last_cycles(np.concatenate([columns["pressure"] for _, columns in even]), 0.5)
    parts = np.split(held, np.cumsum([len(stamps) for stamps, _ in even])[:-1])
    return [record(~part, time=stamps, **columns) for (stamps, columns), part in zip(even, parts, strict=True)]


def error(table, recipe, between=(-np.inf, np.inf)):
    """RMSE of the free run over the held-out cycles, by their range."""
    given = records(table, between)
    model = fit_with_memory(given, recipe).model
    assert len(model.terms) <= 12
    runs = [free_run(model, one.columns).values for one in given]
    held = np.concatenate([~one.training for one in given])
    measured = np.concatenate([one.columns["displacement"] for one in given])
    return nrmse_by_range(measured[held], np.concatenate(runs)[held])


@pytest.fixture(scope="module")
def loops(measured_data):
    folder = measured_data / "coiled_isotonic_loops"
    return {name: np.loadtxt(folder / f"{name}.csv.gz", delimiter=",", skiprows=1) for name in LOOPS}


@pytest.fixture(scope="module")
def steps(measured_data):
    def read(name):
        book = openpyxl.load_workbook(measured_data / "coiled_isotonic_steps" / f"{name}.xlsx", read_only=True, data_only=True)
        return np.array([row[2:5] for row in book.active.iter_rows(values_only=True)], dtype=float)

    return {name: read(name) for name in STEPS}


def test_slow_loops_are_followed_where_static_and_play_models_are_not(loops):
    errors = np.array([[error(loops[name], recipe, between) for name, between in LOOPS.items()] for recipe in (SETTING, STATIC, PLAYS)])
    assert np.median(errors[0]) < 0.04
    assert errors[0].max() < 0.10
    assert (errors[0] < 0.6 * errors[1:].min(axis=0)).all()


def test_steps_are_followed_with_the_same_setting(steps):
    errors = np.array([[error(table, recipe) for table in steps.values()] for recipe in (SETTING, STATIC, PLAYS)])
    assert errors[0].max() < 0.04
    assert (errors[0] < 0.25 * errors[1:].min(axis=0)).all()
