"""Noise-free records made by a known structure are explained by a structure of its kind, no larger
than needed, to the last digits.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from common import dataset_of

from mapmore_cli.annexes.search import candidate, searching
from mapmore_cli.annexes.search.bench import Slice
from mapmore_cli.annexes.search.searching import search
from mapmore_cli.annexes.search.situation import situation_of
from mapmore_cli.annexes.search.trying import choices_of
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.modelling.expressions.operator import Setting, along
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.kinds import rules
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.study.sections.model import ModelChoice
from mapmore_cli.study.sections.split import Holdout

Columns = dict[str, np.ndarray]
STEP = 0.02
WHOLE = Slice(None, ModelChoice(type="auto"), Fuse(), {}, None, (), False)


def surface(rng):
    """A quadratic of two inputs."""
    x, z = rng.uniform(0, 1, (2, 80))
    a = rng.uniform(0.5, 2, 4)
    return {"x": x, "z": z, "y": a[0] + a[1] * x - a[2] * x * z + a[3] * z**2}


def autoregression(rng):
    """Two delays of the output and one product, driven by steps of random height."""
    u = np.repeat(rng.uniform(-1, 1, 50), 12)
    y, a = np.zeros(len(u)), rng.uniform(0.05, 0.15, 2)
    for k in range(2, len(u)):
        y[k] = 1.2 * y[k - 1] - 0.5 * y[k - 2] + a[0] * u[k - 1] + a[1] * u[k - 1] * y[k - 1]
    return {"time": STEP * np.arange(len(u)), "u": u, "y": y}


def slow_and_play(rng):
    """What follows an input slowly, and what follows it with play."""
    u = np.concatenate(
        [np.linspace(a, b, 40) for a, b in itertools.pairwise([0.0, 1.0, *rng.uniform(0, 1, 18)])]
    )
    slow, play = (
        along(OPERATORS[name], u, Setting((number,), STEP, (0.0, 1.0)))
        for name, number in (("slow", 0.4), ("play", 0.25))
    )
    a = rng.uniform(0.5, 2, 3)
    return {"time": STEP * np.arange(len(u)), "u": u, "y": a[0] * u + a[1] * slow + a[2] * play}


class Case(NamedTuple):
    """What makes a record, the families that are searched, and the structure that is to be found,
    with its parameters at most.
    """

    make: Callable[[np.random.Generator], Columns]
    families: tuple[str, ...]
    words: str
    parameters: int


CASES = (
    Case(surface, ("tables",), "quadratic", 6),
    Case(autoregression, ("tables", "feedback"), "two delays of the output, order 2", 6),
)


def explained(case, seed, monkeypatch):
    """Whether a noise-free record is explained by a structure of its kind, in no more parameters
    than it takes.
    """
    monkeypatch.setattr(searching, "FAMILIES", case.families)
    columns = case.make(np.random.default_rng(seed))
    taken = search(dataset_of(columns, output=list(columns)[-1]), WHOLE, beside=False).found
    # a fold that takes an end of the range away cannot say how it goes on there
    exact = np.median(taken.errors) < 1e-9
    return (
        taken.words.startswith(case.words) and taken.parameters <= case.parameters and bool(exact)
    )


@pytest.mark.parametrize(
    "case", [CASES[0], pytest.param(CASES[1], marks=pytest.mark.long)], ids=["surface", "past"]
)
def test_a_noise_free_record_is_explained_by_a_structure_of_its_kind(case, monkeypatch):
    assert explained(case, 0, monkeypatch)


def test_recordings_that_no_memory_fits_are_searched_without_one(
    monkeypatch,
):
    """One early stamp among the held-out samples: the fit of a model with memory would refuse the
    whole recording.
    """
    monkeypatch.setattr(searching, "FAMILIES", ("tables", "feedback"))
    columns = slow_and_play(np.random.default_rng(3))
    columns["time"][-20:] -= 0.3 * STEP
    held_out = np.arange(len(columns["y"])) >= 600
    result = search(dataset_of(columns, held_out=held_out), WHOLE, beside=False)
    assert "feedback" not in {tried.family for tried in result.tried}
    assert "models with memory were not tried" in result.notes[0]
    assert "resample: 0.02 s" in result.notes[0]


def test_behind_a_gap_a_free_run_begins_where_its_output_is_known():
    """The gap lies among held-out samples, whose outputs no fit may use."""
    columns = autoregression(np.random.default_rng(0))
    time = columns["time"] / STEP
    gap = np.round(time) != 350
    cut = dataset_of({name: x[gap] for name, x in columns.items()})
    held_out = (time[gap] >= 300) & (time[gap] < 400)
    dataset = replace(cut, curves=(replace(cut.curves[0], held_out=held_out),))
    sections = {
        "dictionary": [{"terms": ["y[k-1]", "y[k-2]", "u[k-1]", "u[k-1]*y[k-1]"]}],
        "fit": {"max_terms": 4, "criterion": "free_run"},
    }
    model = refit(choices_of(sections, WHOLE), dataset)
    (curve,) = dataset.curves
    predicted = forecast(model, curve)
    missed = (predicted.values - curve.columns["y"])[predicted.ready]
    assert missed.size > 500
    np.testing.assert_allclose(missed, 0, atol=1e-6)


def piston(seed):
    """A piston at uneven steps of time, whose friction changes its sign with the direction of
    motion, and grows with the pressure.
    """
    rng = np.random.default_rng(seed)
    x = np.concatenate([np.linspace(*ends, 30) for ends in [(0, 1), (1, 0)] * 4])
    pressure = np.repeat(rng.uniform(1, 3, 8), 30)
    side = along(OPERATORS["stop"], x, Setting((0.02,), STEP, (0.0, 1.0))) / 0.02
    force = 30 * pressure - 4 * x + (3 + 2 * pressure) * side
    time = np.cumsum(rng.uniform(0.5, 1.5, len(x)) * STEP)
    return {"time": time, "x": x, "pressure": pressure, "y": force}


def test_direction_of_motion_is_found_at_uneven_steps(monkeypatch):
    tables = searching.family("tables")
    few = [one for one in tables["candidates"] if one.get("kind") in ("simple", "direction")]
    monkeypatch.setattr(searching, "FAMILIES", ("tables",))
    monkeypatch.setattr(searching, "family", lambda _name: {**tables, "candidates": few})
    dataset = dataset_of(piston(0))
    result = search(dataset, WHOLE, beside=False)
    assert result.notes[0].startswith("models with memory were not tried: ")
    assert "resample" in result.notes[0]
    taken = result.found
    assert taken.words == "plane and direction of x in 0.02 of its range"
    assert taken.parameters == 5
    assert taken.error < 1e-3
    (unseen,) = dataset_of(piston(1)).curves
    model = refit(choices_of(taken.sections, WHOLE), dataset)
    assert np.ptp(unseen.columns["time"]) != np.ptp(dataset.curves[0].columns["time"])
    values = forecast(model, unseen).values
    np.testing.assert_allclose(values, unseen.columns["y"], atol=0.01 * np.ptp(values))
    assert "whatever the time between them" in " ".join(rules(model))


def test_direction_is_not_tried_where_no_model_may_run_along_recordings():
    dataset, drawn = dataset_of(piston(0)), Holdout.model_validate({"fraction": 0.2})
    assert WHOLE.in_order(dataset)
    assert not replace(WHOLE, by_level=True).in_order(dataset)
    assert not replace(WHOLE, held_out=drawn).in_order(dataset)
    without_clock = {name: x for name, x in piston(0).items() if name != "time"}
    assert not WHOLE.in_order(dataset_of(without_clock))
    looked_at = situation_of(dataset)
    assert not looked_at.timed
    kinds = [
        {one.family for one in candidate.offered_structures(searching.family("tables"), situation)}
        for situation in (looked_at, replace(looked_at, ordered=True))
    ]
    assert ["direction" in of for of in kinds] == [False, True]


def test_how_a_polynomial_goes_on_beyond_its_ends_is_chosen_by_left_out_data(monkeypatch):
    """What levels off before the end that is held out: a quadratic that is held errs less there
    than the same one that is continued, and is tried as every other structure is.
    """
    tables = searching.family("tables")
    plain = [one for one in tables["candidates"] if one["words"] in ("plane", "quadratic")]
    monkeypatch.setattr(searching, "FAMILIES", ("tables",))
    monkeypatch.setattr(searching, "family", lambda _name: {**tables, "candidates": plain})
    x = np.linspace(0, 1, 120)
    columns = {"x": x, "y": np.minimum(x * (1.6 - x), 0.6)}
    whole = dataset_of(columns, held_out=x > 0.8)
    part = replace(WHOLE, held_out=Holdout.model_validate({"x": {"between": [[0.8, 1]]}}))
    tried = {one.words: one for one in search(whole, part, beside=False).tried}
    held, continued = tried["quadratic, held"], tried["quadratic"]
    assert held.sections["fuse.extrapolation"] == "saturate"
    assert held.excess < continued.excess - 0.1
