"""The backbone that left-out training levels choose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import QUANTITIES, curves, recipe

from mapmore_cli.modelling import literature
from mapmore_cli.modelling.pieces.backbone_choice import FEW, MARGIN, Candidate, candidates, choose_backbone, simplest, thin
from mapmore_cli.modelling.pieces.recipe import Cuts

LEVELS = (80.0, 150.0, 250.0, 350.0)
SETTINGS = {"max_terms": 2, "cuts": {"strain": Cuts("even", 2)}, "dictionary": ("1", "strain", "strain^2")}


def of_formula(name, levels=LEVELS, noise=0.5, seed=0):
    """Curves that a formula with made-up parameters has made."""
    rng = np.random.default_rng(seed)
    made = curves(levels=levels, held_out=(), n=25)
    fit = literature.get(name).fit(*_pooled(made))
    made = [replace(c, columns={**c.columns, "force": literature.get(name).predict(fit.parameters, c.columns)}) for c in made]
    return [replace(c, columns={**c.columns, "force": c.columns["force"] + rng.normal(0, noise, c.size)}) for c in made]


def _pooled(made):
    columns = {name: np.concatenate([c.columns[name] for c in made]) for name in ("pressure", "strain", "force")}
    return columns, columns["force"]


@pytest.mark.parametrize("name", ["polynomial_2", "sarosi"])
def test_what_made_the_data_is_chosen(name):
    choice = choose_backbone(of_formula(name), recipe(**SETTINGS), QUANTITIES)
    assert choice.name == name
    assert f"backbone {name} is chosen: with each of 2 inner training levels left out" in choice.note
    assert "outermost level left out" in choice.note


def test_held_out_samples_decide_nothing():
    samples = curves(levels=(*LEVELS, 450.0), held_out=(250.0,), n=25)
    spoilt = [replace(c, columns={**c.columns, "force": np.where(c.held_out, -7.0, c.columns["force"])}) for c in samples]
    one, two = (choose_backbone(of, recipe(**SETTINGS), QUANTITIES) for of in (samples, spoilt))
    assert one == two


def test_three_levels_choose_nothing():
    choice = choose_backbone(curves(levels=LEVELS[:3], held_out=()), recipe(), QUANTITIES)
    assert choice.name == FEW
    assert "too few to choose" in choice.note


def test_candidates_are_the_static_formulas_of_the_inputs():
    names = candidates(curves(), "force")
    assert {None, "sarosi", "polynomial_5", FEW} <= set(names)
    assert not {"reynolds", "none", "muscle_like", "polynomial_3"} & set(names)
    without = [replace(c, columns={"load": c.columns["pressure"], "force": c.columns["force"]}) for c in curves()]
    assert candidates(without, "force") == (None,)


@given(st.lists(st.tuples(st.sampled_from([None, "sarosi", "polynomial_2", "polynomial_5"]), st.floats(1, 2)), min_size=1, max_size=6))
def test_the_simplest_within_the_margin_is_taken(given_errors):
    found = [Candidate(name, rmse, 1.0) for name, rmse in given_errors]
    chosen, least = simplest(found), min(one.rmse for one in found)
    assert chosen.rmse <= (1 + MARGIN) * least
    assert all(one.rmse > (1 + MARGIN) * least for one in found if one.parameters < chosen.parameters)


@settings(max_examples=20)
@given(st.integers(1, 2000), st.integers(0, 100))
def test_thinned_curves_keep_an_even_share_of_the_training_samples(n, seed):
    (curve,) = curves(levels=(80.0,), held_out=(), n=n, seed=seed)
    held = replace(curve, held_out=np.arange(n) % 5 == 0) if n > 5 else curve
    few = thin(held, "strain")
    kept = int(held.training.sum())
    assert min(kept, 150) <= few.size <= 300
    assert not few.held_out.any()
    assert np.isin(few.columns["strain"], held.columns["strain"][held.training]).all()
