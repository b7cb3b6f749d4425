"""The list of structures goes on where a black box errs clearly less than what it has, and ends
where longer structures gain nothing.
"""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from common import dataset_of

from mapmore_cli.annexes.search import further, searching, stage
from mapmore_cli.annexes.search.bench import Slice
from mapmore_cli.annexes.search.black_boxes import black_boxes
from mapmore_cli.annexes.search.further import go_on
from mapmore_cli.annexes.search.searching import search
from mapmore_cli.annexes.search.situation import situation_of
from mapmore_cli.annexes.search.trying import choices_of
from mapmore_cli.domain.results import Search, Tried
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.study.sections.model import ModelChoice

WHOLE = Slice(None, ModelChoice(type="auto"), Fuse(), {}, None, (), False)
SHORT = replace(WHOLE, model=ModelChoice(type="auto", prefer="short"))


def choice_of(*structures, box):
    """A search whose last structure is taken, beside a black box; all by error and parameters."""
    tried = [
        Tried("surface", f"structure {number}", {}, size, error=error, excess=np.log(error))
        for number, (error, size) in enumerate(structures)
    ]
    tried.append(Tried("black box", "gradient boosting", {}, error=box))
    last = len(structures) - 1
    return Search("search", "y", "", "", 1.0, tuple(tried), last, last)


@pytest.mark.parametrize(
    ("box", "rounds", "asked", "chosen"),
    [
        (0.95, [(0.50, 30)], [], 0),  # the black box errs hardly less
        (0.50, [(0.99, 30)], ["second"], 0),  # gains less than 5 %
        (0.50, [(0.99, 10)], ["second"], 1),  # so does this one, but with no more parameters
        (0.50, [(1.01, 9)], ["second"], 0),
        (0.50, [(0.94, 280)], ["second"], 0),  # gains less than its parameters cost
        (0.50, [(0.80, 12), (0.79, 13)], ["second", "third"], 1),  # the last gains nothing
        (0.50, [(0.51, 12)], ["second"], 1),  # then the black box errs hardly less
        (0.10, [(0.80, 12), (0.60, 13)], ["second", "third"], 2),
    ],
)
def test_rounds_go_on_while_a_black_box_errs_less_and_one_gains(box, rounds, asked, chosen):
    structures, names = [(1.0, 10)], []

    def with_round(name):
        names.append(name)
        structures.append(rounds[len(names) - 1])
        return choice_of(*structures, box=box)

    first = choice_of(*structures, box=box)
    bench = SimpleNamespace(asks_parts=False)
    result = go_on(first, bench, with_round)
    assert (names, result.chosen) == (asked, chosen)
    assert result.short == (0 if asked else None)


@pytest.mark.parametrize(
    ("found", "chosen", "words", "advised"),
    [
        ((1.0, 10), 0, "none of them gains 5 % over structure 0", False),
        ((0.98, 10), 1, "smaller by a factor of 1.02 than that of structure 0 with 10", False),
        ((0.5, 11), 1, "smaller by a factor of 2 than that of structure 0 with 10", True),
    ],
)
def test_the_short_structure_is_recommended_only_if_it_has_fewer_parameters(
    found, chosen, words, advised
):
    result = replace(choice_of((1.0, 10), found, box=0.4), short=0, chosen=chosen)
    note = further.longer_note(result)
    assert words in note
    assert ("prefer: short" in note) == advised


def smooth_map(size, seed=0):
    """A smooth map of three inputs, a fifth of it held out."""
    rng = np.random.default_rng(seed)
    x, z, w = rng.uniform(0, 1, (3, size))
    y = np.sin(3 * x * z) + x * np.exp(-2 * (w - 0.4) ** 2) + np.tanh(3 * (z - w)) / 2
    noisy = y + 0.005 * np.ptp(y) * rng.standard_normal(size)
    return dataset_of({"x": x, "z": z, "w": w, "y": noisy}, held_out=rng.random(size) < 0.2)


def held_out_error(dataset, found):
    """RMSE of a structure on the held-out samples."""
    model, (curve,) = refit(choices_of(found.sections, WHOLE), dataset), dataset.curves
    missed = forecast(model, curve).values - curve.columns["y"]
    return float(np.sqrt(np.mean(missed[curve.held_out] ** 2)))


def error_of_process(dataset):
    """RMSE of the Gaussian process of the search on the held-out samples."""
    situation, (curve,) = situation_of(dataset), dataset.curves
    (missed,) = next(
        left
        for one, left in black_boxes(dataset, [curve.held_out], situation)
        if one.words == "gaussian process"
    )
    return float(np.sqrt(np.mean(missed**2)))


def only(monkeypatch, **kinds):
    """Search structures of some kinds alone, by the file that they are in."""
    every = searching.family
    families = {
        name: {**every(name), "candidates": [one for one in every(name)["candidates"] if of(one)]}
        for name, of in kinds.items()
    }
    monkeypatch.setattr(searching, "FAMILIES", ("tables",))
    monkeypatch.setattr(searching, "family", families.__getitem__)
    monkeypatch.setattr(further, "ROUNDS", tuple(kinds)[1:])


def is_plain(one):
    return one.get("kind") == "simple"


def is_of_higher_order(one):
    return one["words"].endswith("of the inputs")


def exact(_dataset, folds, _situation):
    """A black box that errs nowhere."""
    return [(Tried("black box", "oracle", {}), [np.zeros(int(fold.sum())) for fold in folds])]


def test_a_smooth_map_gets_more_terms_unless_the_study_prefers_the_short_one(monkeypatch):
    only(monkeypatch, tables=is_plain, second=is_of_higher_order)
    monkeypatch.setattr(searching, "black_boxes", exact)
    dataset = smooth_map(300)
    long, short = search(dataset, WHOLE), search(dataset, SHORT)
    assert short.short is None
    assert short.found.words == long.tried[long.short].words
    assert short.found.words.startswith("cubic")
    assert long.found.family == "longer"
    assert 20 <= long.found.parameters <= 28
    assert long.found.error < 0.8 * short.found.error
    assert any("prefer: short" in note and "cubic" in note for note in long.notes)
    assert "structure lacks something" in short.outdone
    assert short.outdone in short.notes


def test_black_boxes_are_tried_on_the_samples_of_the_folds(monkeypatch):
    """Folds have fewer samples than the study, of which some are held out."""
    only(monkeypatch, tables=is_plain)
    monkeypatch.setattr("mapmore_cli.annexes.search.black_boxes.find_spec", lambda _name: None)
    (box,) = (one for one in search(smooth_map(100), SHORT).tried if one.family == "black box")
    assert 0 < box.error < 0.1


@pytest.mark.parametrize("short", [None, 0])
def test_searches_without_some_data_go_on_only_where_that_of_all_data_did(short, monkeypatch):
    """Black boxes cost time, and are asked for nothing where no later round may follow."""
    whole, asked = choice_of((1.0, 10), box=1.0), list[bool]()
    files = SimpleNamespace(search=lambda: replace(whole, short=short))
    records = {"search": SimpleNamespace(slice=WHOLE)}
    monkeypatch.setattr(stage, "load_records", lambda *_: records)
    monkeypatch.setattr(stage, "RunFiles", lambda _run: files)
    monkeypatch.setattr(stage, "search", lambda *_, beside: asked.append(beside) or whole)
    stage.searching_again(Path())(None)
    assert asked == [short is not None]


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1])
def test_a_large_smooth_map_is_as_good_as_a_gaussian_process(seed, monkeypatch):
    only(monkeypatch, tables=is_plain, second=is_of_higher_order, third=is_of_higher_order)
    monkeypatch.setattr("mapmore_cli.annexes.search.black_boxes.find_spec", lambda _name: None)
    dataset = smooth_map(26_000, seed)
    found = search(dataset, WHOLE).found
    assert held_out_error(dataset, found) <= 1.05 * error_of_process(dataset)


def additive_splines(dataset):
    """RMSE of least squares on cubic splines of every input, on the held-out samples."""
    (curve,) = dataset.curves
    parts = []
    for name in set(dataset.quantities) - {"y"}:
        x = curve.columns[name]
        powers = [x, x**2, x**3]
        parts += powers + [np.maximum(x - knot, 0) ** 3 for knot in np.linspace(0, 1, 7)[1:-1]]
    basis, y = np.column_stack([np.ones_like(x), *parts]), curve.columns["y"]
    theta = np.linalg.lstsq(basis[~curve.held_out], y[~curve.held_out], rcond=None)[0]
    return float(np.sqrt(np.mean((basis @ theta - y)[curve.held_out] ** 2)))


@pytest.mark.long
@pytest.mark.parametrize("inputs", [8, 16])
@pytest.mark.parametrize("pairs", [0, 1], ids=["sum", "sum_and_product"])
def test_many_inputs_are_as_good_as_additive_splines(inputs, pairs):
    rng = np.random.default_rng(inputs)
    x = rng.uniform(0, 1, (inputs, 2000))
    y = sum(np.sin((2 + 0.7 * i) * one + i) / (1 + 0.2 * i) for i, one in enumerate(x))
    y = y + pairs * x[0] * x[1] + 0.05 * rng.standard_normal(2000)
    columns = {**dict(zip("abcdefghijklmnop", x, strict=False)), "y": y}
    dataset = dataset_of(columns, held_out=rng.random(2000) < 0.2)
    found = search(dataset, WHOLE, beside=False).found
    assert held_out_error(dataset, found) <= 1.01 * additive_splines(dataset)
