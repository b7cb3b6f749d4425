"""Families of candidates: what they offer is made of what is there, and can be fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common import dataset_of

from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.search_bench import Bench, Slice, holds_ends_out, searchable
from mapmore_cli.fitting.searching import choices_of
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.modelling.search.choice import chosen_of
from mapmore_cli.modelling.search.families import FAMILIES
from mapmore_cli.modelling.search.situation import Situation, situation_of
from mapmore_cli.spec.sections.data import Holdout
from mapmore_cli.spec.sections.model import ModelChoice

WHOLE = Slice(None, ModelChoice(type="auto"), Fuse(), {}, None, (), False)
SITUATIONS = {
    "map": Situation("force", ("strain", "pressure"), "pressure", frozenset({"strain", "pressure", "force"}), 60, 5),
    "record": Situation("y", ("u",), None, frozenset({"u", "y", "time"}), 800, 1, 0.01, 8.0, {"u": 1.0}, {("u", 1): 0.1}),
    "pair": Situation(
        "torque", ("p1", "p2", "x", "v"), None, frozenset({"time"}), 900, 1, 0.01, 9.0, {"x": 1.0, "v": 2.0}, {("x", 1): 0.1, ("v", 3): 0.2}
    ),
    "many": Situation("y", tuple("abcdefgh"), None, frozenset("abcdefgh"), 500, 1, 0.1, 50.0),
}


@pytest.mark.parametrize("name", SITUATIONS)
def test_every_candidate_is_a_valid_structure_of_the_inputs(name: str) -> None:
    of = SITUATIONS[name]
    words = []
    for family in FAMILIES.values():
        for candidate in family.candidates(of) if family.applies(of) else ():
            choices_of(candidate.sections, WHOLE)  # validates, or raises
            words.append(candidate.words)
    assert len(words) == len(set(words)) > 2


def test_nothing_along_the_level_is_steeper_than_levels_are_apart() -> None:
    """Five levels are a quarter of the range apart: a step of 0.15 between two of them follows no sample; one of 0.4 does."""
    texts = str([candidate.sections for candidate in FAMILIES["steep"].candidates(SITUATIONS["map"])])
    assert "tanh((strain-0.25)/0.05)" in texts
    assert "tanh((pressure-0.25)/0.4)" in texts
    assert "tanh((pressure-0.25)/0.15)" not in texts
    assert "abs(pressure-0.5)" in texts
    assert "abs(pressure-0.25)" not in texts


def test_constants_copies_and_the_clock_are_no_inputs() -> None:
    time = np.arange(100) * 0.01
    u, y = np.sin(time), np.cos(time)
    found = situation_of(dataset_of({"time": time, "u": u, "twice": 2 * u + 1, "still": np.ones(100), "y": y}))
    assert found.inputs == ("twice",)
    assert found.step == pytest.approx(0.01)
    assert situation_of(dataset_of({"time": time**2, "u": u, "y": y})).step is None


def test_what_is_held_out_is_not_looked_at() -> None:
    time, u = np.arange(100) * 0.01, np.r_[np.linspace(0, 1, 80), np.full(20, 9.0)]
    held_out = np.arange(100) >= 80
    other = np.where(held_out, -50.0, u)
    one, two = (dataset_of({"time": time, "u": of, "y": u}, held_out=held_out) for of in (u, other))
    assert situation_of(one) == situation_of(two)


FIRST = {  # errors of the first structure on every fold, and of the others
    "within one standard error": [[1.0, 1.2, 1.1], [1.0, 1.1, 1.15], [3.0, 3.1, 2.9]],
    "11 % worse, within one standard error": [[1.0, 1.6, 1.1], [1.0, 1.1, 1.15], [3.0, 3.1, 2.9]],
    "2 % worse": [[1.0, 1.2, 1.1], [1.0, 1.1, 1.14]],
    "1.5 % worse on every fold": [[1.015] * 3, [1.0] * 3, [1.06] * 3],
}
CHOICES = [
    ("within one standard error", (4, 9, 1), False, 0),
    ("11 % worse, within one standard error", (4, 9, 1), False, 1),
    ("11 % worse, within one standard error", (4, 9, 1), True, 0),  # in tables more counts as good
    ("2 % worse", (6, 7), False, 1),  # simplicity has a price: half of the parameters, and not one of seven
    ("2 % worse", (3, 7), False, 0),
    ("1.5 % worse on every fold", (4, 9, 1), False, 0),
]


@pytest.mark.parametrize(("first", "parameters", "tables", "chosen"), CHOICES)
def test_the_simplest_that_is_as_good_is_taken(first: str, parameters: tuple[int, ...], tables: bool, chosen: int) -> None:
    ranked = chosen_of(parameters, np.array(FIRST[first]), np.zeros((len(parameters), 0)), tables=tables)
    assert (ranked.best, ranked.chosen) == (1, chosen)


def test_where_a_study_holds_levels_out_they_decide() -> None:
    blocks, parts = np.array([[1.0, 1.1], [2.2, 2.4]]), np.array([[4.0, 5.0], [2.0, 2.2]])  # 2.2 times less, and 2.1 times more
    assert chosen_of([8, 8], blocks, parts, tables=True, asked=False).chosen == 0
    assert chosen_of([8, 8], blocks, parts, tables=True, asked=True).chosen == 1


def test_bands_of_an_input_are_left_out_where_the_study_holds_some_out() -> None:
    """A pressure swept up and down: pieces of the time hold all of its values, and ask for nothing between."""
    time = np.arange(600) * 0.01
    u = 100 * np.abs((time % 2) - 1)
    held_out = (u >= 40) & (u <= 60)
    whole = dataset_of({"time": time**2, "u": u, "y": u}, held_out=held_out)
    part = replace(WHOLE, held_out=Holdout.model_validate({"u": {"between": [[40, 60]]}}))
    found = searchable(whole)
    folds = Bench.of(found, situation_of(found), part).blocks
    values = found.curves[0].columns["u"]
    assert len(folds) == 5
    assert all(10 < np.ptp(values[fold[0]]) <= 20 for fold in folds)
    assert not any((fold[0] & found.curves[0].held_out).any() for fold in folds)


def test_splines_go_straight_between_levels() -> None:
    """So that three levels tell them."""
    (alone,) = FAMILIES["splines"].candidates(replace(SITUATIONS["map"], curves=3))
    assert "pressure*abs(strain-0.5)^3" in str(alone.sections)
    assert "pressure^2" not in str(alone.sections)


def test_recordings_too_short_to_say_or_too_long_to_miss_are_not_left_out() -> None:
    def recorded(*sizes: int) -> Dataset:
        return dataset_of(*(dict.fromkeys(("time", "u", "y"), np.arange(size) * 0.01) for size in sizes))

    def left_out(dataset: Dataset) -> list[list[int]]:
        return [[int(mask.sum()) for mask in fold] for fold in Bench.of(dataset, situation_of(dataset), WHOLE).parts]

    assert left_out(recorded(100, 100, 100)) == [[100, 0, 0], [0, 100, 0], [0, 0, 100]]
    assert left_out(recorded(10, 3000)) == []
    assert left_out(recorded(10, 100, 100)) == []  # without either of the long ones half is left


def test_folds_resemble_what_the_study_holds_out() -> None:
    time = np.arange(1000) * 0.01

    def folds(held_out: np.ndarray) -> tuple[Bench, bool]:
        whole = dataset_of({"time": time, "u": np.sin(time), "y": np.where(held_out, 1e9, np.cos(time))}, held_out=held_out)
        found, behind = searchable(whole), holds_ends_out(whole)
        return Bench.of(found, situation_of(found), WHOLE, behind), behind

    def runs(mask: np.ndarray) -> int:
        return int((np.diff(np.concatenate([[0], mask.astype(int)])) == 1).sum())

    pieces, behind = folds((np.arange(1000) % 200 >= 160) & (np.arange(1000) < 900))
    assert not behind
    assert len(pieces.blocks) == 5
    assert all(runs(fold[0]) >= 4 for fold in pieces.blocks)
    output = pieces.dataset.curves[0].columns["y"]
    assert np.isnan(output).sum() == 160  # the inputs stay, the outputs do not
    assert pieces.scale <= 2
    assert not any(np.isnan(output[fold[0]]).any() for fold in pieces.blocks)

    ends, behind = folds(np.arange(1000) >= 600)
    assert behind
    assert ends.dataset.curves[0].size == 600
    assert [int(fold[0].sum()) for fold in ends.parts] == [120, 210, 300]
    assert all(fold[0][-1] for fold in ends.parts)
