"""Which model `init` proposes: a surface for scattered points and for few on a curve, a choice of backbone, a model that is inverted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.drafting.model import CHOOSING_LEVELS, FEWEST_ON_A_CURVE, SAMPLES_OF_A_SEGMENT, with_model
from mapmore_cli.study.drafting.proof import _chosen

QUANTITIES = {"pressure": Quantity("pressure", "kPa"), "strain": Quantity("strain", "1"), "force": Quantity("force", "N")}


def drafted(dataset: Dataset, *inputs: str) -> dict[str, Any]:
    return with_model(Draft({"name": "study", "target": "static"}), dataset, inputs).spec


def levels(count: int, samples: int, target: str = "force") -> Dataset:
    curves = []
    for pressure in 100.0 * np.arange(1, count + 1):
        strain = np.linspace(0, 0.1, samples)
        columns = {"pressure": np.full(samples, pressure), "strain": strain, "force": pressure * (1 - 4 * strain)}
        curves.append(Curve(f"pressure={pressure:g}", pressure, columns, np.zeros(samples, dtype=bool), ("table",)))
    return Dataset(target, "pressure", QUANTITIES, (), tuple(curves))


def scattered(samples: int) -> Dataset:
    rng = np.random.default_rng(0)
    pressure, strain = rng.uniform(100, 500, samples), rng.uniform(0, 0.1, samples)
    columns = {"pressure": pressure, "strain": strain, "force": pressure * (1 - 4 * strain)}
    return Dataset("force", None, QUANTITIES, (), (Curve("table", None, columns, np.zeros(samples, dtype=bool), ("table",)),))


def test_scattered_points_are_one_surface_cut_along_both_inputs() -> None:
    spec = drafted(scattered(60), "pressure", "strain")
    cut = {"method": "even", "count": 2, "min_samples": SAMPLES_OF_A_SEGMENT}
    assert spec["segment"] == {"pressure": cut, "strain": cut}
    assert spec["dictionary"] == [{"polynomial": {"of": ["pressure", "strain"], "order": 3}}]
    assert spec["model"]["backbone"] == "auto"
    assert "segment" not in drafted(scattered(4 * SAMPLES_OF_A_SEGMENT - 1), "pressure", "strain")


@pytest.mark.parametrize(("samples", "pooled"), [(FEWEST_ON_A_CURVE - 1, True), (FEWEST_ON_A_CURVE, False)])
def test_few_points_on_a_curve_are_pooled(samples: int, pooled: bool) -> None:
    spec = drafted(levels(6, samples), "pressure", "strain")
    assert (spec.get("segment") == {"pressure": "none"}) == pooled
    assert spec["dictionary"] == [{"polynomial": {"of": ["pressure", "strain"] if pooled else ["strain"], "order": 3}}]
    assert spec["model"]["backbone"] == "auto"


@pytest.mark.parametrize(("count", "backbone"), [(CHOOSING_LEVELS - 1, "sarosi"), (CHOOSING_LEVELS, "auto")])
def test_the_backbone_is_chosen_where_there_are_levels_to_choose_by(count: int, backbone: str) -> None:
    assert drafted(levels(count, 50), "pressure", "strain")["model"]["backbone"] == backbone


def test_a_model_of_the_strain_is_scored_as_force() -> None:
    spec = drafted(levels(5, 60, "strain"), "pressure", "force")
    assert spec["validate"] == {"as": "force", "against": ["sarosi", "polynomial_2", "polynomial_5"]}
    assert "model" not in spec
    assert list(spec["segment"]) == ["force"]


def test_a_formula_with_more_parameters_than_there_are_samples_is_no_competitor() -> None:
    assert "polynomial_5" in drafted(levels(2, 11), "pressure", "strain")["validate"]["against"]
    assert "polynomial_5" not in drafted(levels(2, 10), "pressure", "strain")["validate"]["against"]


def test_a_trial_of_a_draft_takes_the_usual_backbone() -> None:
    assert _chosen({"model": {"backbone": "auto"}}) == {"model": {"backbone": "sarosi_hinged"}}
    assert _chosen({"name": "study"}) == {"name": "study"}
