"""What a fit reads of a spec, by hand."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from mapmore_cli.fitting import baselines
from mapmore_cli.fitting.kinds.choices import (
    by_trial,
    fit_choices,
    lengths_of,
    level_of,
    model_choices,
    summands,
    with_definitions,
)
from mapmore_cli.fitting.kinds.dictionary import signal_of
from mapmore_cli.fitting.kinds.pieces import recipe_of
from mapmore_cli.modelling.literature.own import formula_of, is_family
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.data import Direction, Levels, Rate
from mapmore_cli.study.sections.model import ModelChoice

SPEC = {
    "name": "a",
    "data": {
        "files": ["a.csv"],
        "columns": {name: {"column": name} for name in ("pressure", "strain", "force")},
        "levels": {"of": "pressure"},
    },
    "target": "static",
    "dictionary": [{"terms": ["strain"]}],
    "fuse": {"z_s": 0.1},
}


def spec_of(**changes):
    return ExperimentSpec.model_validate({**SPEC, **changes})


@pytest.mark.parametrize(
    ("of", "segment", "level"),
    [
        ("pressure", {}, "pressure"),
        ("pressure", {"pressure": "none"}, None),
        ("pressure", {"strain": "none"}, "pressure"),
        ("step_pressure", {"step_pressure": "levels"}, "pressure"),
    ],
)
def test_curves_are_interpolated_between_levels_unless_they_are_pooled(of, segment, level):
    assert level_of(Levels(of=of), segment) == level
    part = replace(model_choices(spec_of()), levels=Levels(of=of), segment=segment)
    recipe = recipe_of("force", part)
    assert (recipe.level, recipe.pooled) == (level, None if level else of)
    assert recipe_of("force", replace(part, levels=None)).pooled is None


@pytest.mark.parametrize(("method", "tried"), [("optimal", True), ("gradient", False)])
def test_boundaries_are_found_by_trial_if_those_of_one_input_are_optimal(method, tried):
    cuts = {name: {"method": "even", "count": 2} for name in ("strain", "force")}
    segment = {**cuts, "force": {"method": method, "count": 2}, "pressure": "none"}
    assert by_trial(spec_of(target={"column": "pressure"}, segment=segment).segment) is tried


def test_a_fit_depends_on_the_fusion_only_if_it_chooses_a_backbone():
    assert fit_choices(spec_of()).fuse == Fuse()
    assert fit_choices(spec_of(model={"backbone": "auto"})).fuse == Fuse(z_s=0.1)
    assert model_choices(spec_of()).fuse == Fuse(z_s=0.1)


def test_a_formula_gets_the_dimensions_that_it_needs():
    lengths = {"length": 0.1, "diameter": 0.02}
    sized = ModelChoice(type="literature", name="tondu_lopez_fixed_area")
    assert lengths_of(sized, lengths) == {"diameter": 0.02}
    for model in (ModelChoice(), ModelChoice(backbone="auto"), ModelChoice(backbone="sarosi")):
        assert lengths_of(model, lengths) == {}


def test_a_sum_adds_the_runs_that_it_names_each_once():
    parts = [{"model": "a.yaml"}, {"model": "b.yaml", "sign": -1}, {"model": "a.yaml"}]
    added = spec_of(dictionary=[], model={"sum": parts})
    assert summands(added) == ["a.yaml", "b.yaml"]
    needs = {"static": "s.yaml", "damping": "d.yaml"}
    both = spec_of(dictionary=[], target="dynamic", needs=needs)
    assert summands(both) == ["s.yaml", "d.yaml"]
    assert summands(spec_of(needs=needs)) == []


def test_definitions_take_the_place_of_the_names_of_own_formulas():
    own = {"name": "own", "expression": "a*pressure", "parameters": {"a": {}}}
    pair = {"as": "pair", "sum": [{"formula": "own"}, {"formula": "sarosi"}]}
    against = ["own", "sarosi", {"model": "own", "as": "b"}, pair]
    spec = spec_of(formulas=[own], model={"backbone": "own"}, validate={"against": against})
    made = with_definitions(spec)
    text = made.model.backbone
    assert formula_of(text).inputs == ("pressure",)
    first, second, third, fourth = made.validation.against
    assert (first.model, first.label, second) == (text, "own", "sarosi")
    assert (third.model, third.label, fourth.label) == (text, "b", "pair")
    assert [part.formula for part in fourth.sum] == [text, "sarosi"]
    plain = spec_of()
    assert with_definitions(plain) is plain


def test_a_family_has_a_formula_of_its_own():
    family = {"family": {"of": "pressure"}}
    assert is_family(with_definitions(spec_of(dictionary=[], model=family)).model.name)
    with pytest.raises(ValidationError, match="own formula"):
        spec_of(dictionary=[], model={**family, "name": "sarosi"})


@pytest.mark.parametrize(
    ("terms", "kind", "over_time"),
    [({"terms": ["strain"]}, "pieces", False), ({"play": {"of": ["strain"]}}, "memory", True)],
)
def test_a_dictionary_with_memory_makes_a_model_over_time(terms, kind, over_time):
    choices = model_choices(spec_of(dictionary=[terms]))
    assert (choices.kind, choices.over_time) == (kind, over_time)
    formula = {"type": "literature", "name": "sarosi"}
    assert model_choices(spec_of(dictionary=[], model=formula)).kind == "formula"


def test_a_rate_is_in_the_units_of_the_model():
    units = {"x": "mm", "time": "ms", "v": "m/s", "d": "1"}
    rate = signal_of("v", Rate(rate_of="x", window=0.1, order=2), units)
    assert (rate.kind, rate.of, rate.window, rate.order) == ("rate", "x", 0.1, 2)
    assert (rate.factor, rate.seconds) == pytest.approx((1e-3, 1e-3))
    turn = signal_of("d", Direction(direction_of="v", dead_band=0.5), units)
    assert (turn.kind, turn.of, turn.dead_band, turn.window) == ("direction", "v", 0.5, 0)


def test_a_black_box_learns_from_scaled_samples(monkeypatch):
    """Columns have mean 0 and deviation 1, and a constant column is 0."""
    seen = []

    class Learner:
        def fit(self, x, y):
            seen.append((x, y))

        def predict(self, x):
            return x[:, 0]

    learner = replace(baselines.LEARNERS["mlp"], make=lambda _features: Learner())
    monkeypatch.setattr(baselines, "LEARNERS", {"first": learner})
    x = np.array([[1.0, 5.0], [3.0, 5.0]])
    predict = baselines.learned("first", x, np.array([10.0, 30.0]))
    ((inputs, outputs),) = seen
    assert inputs.tolist() == [[-1, 0], [1, 0]]
    assert outputs.tolist() == [-1, 1]
    assert predict(np.array([[4.0, 5.0], [2.0, np.nan]])) == pytest.approx(
        [40, np.nan], nan_ok=True
    )
