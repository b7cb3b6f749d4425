"""Families of candidates: what they offer is made of what is there, and can be fitted."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from common import curve_of, dataset_of

from mapmore_cli.annexes.search import choosing, searching
from mapmore_cli.annexes.search.bench import Bench, Slice
from mapmore_cli.annexes.search.candidate import MOST_PARAMETERS, offered_structures, vocabulary
from mapmore_cli.annexes.search.choosing import choose_structure
from mapmore_cli.annexes.search.further import ROUNDS
from mapmore_cli.annexes.search.samples import cut_short, searchable
from mapmore_cli.annexes.search.searching import FAMILIES, family, most_parameters
from mapmore_cli.annexes.search.situation import Situation, situation_of
from mapmore_cli.annexes.search.trying import choices_of
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.domain.results import Tried
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.loader import findings
from mapmore_cli.study.sections.data import Levels
from mapmore_cli.study.sections.model import ModelChoice
from mapmore_cli.study.sections.split import Holdout

CONFIGS = Path(__file__).parents[2] / "configs"
WHOLE = Slice(None, ModelChoice(type="auto"), Fuse(), {}, None, (), False)
SITUATIONS = {
    "map": Situation(
        "force",
        ("strain", "pressure"),
        "pressure",
        60,
        5,
    ),
    "record": Situation(
        "y",
        ("u",),
        None,
        800,
        1,
        0.01,
        800,
        ("u",),
    ),
    "pair": Situation(
        "torque",
        ("p1", "p2", "x", "v"),
        None,
        900,
        1,
        0.01,
        900,
        ("x", "v"),
    ),
    "loads": Situation("y", ("p", "held"), "held", 900, 6, 0.01, 900, ("p",)),
    "many": Situation("y", tuple("abcdefgh"), None, 500, 1, 0.1, 500),
}


def bench_of(whole, part=WHOLE):
    """The bench of what may be searched in a dataset."""
    found = searchable(whole)
    return Bench.of(found, situation_of(found), part, whole)


def offered(of):
    files = (*FAMILIES, *ROUNDS)
    return [one for name in files for one in offered_structures(family(name), of)]


def spec_of(candidate, of):
    """The spec of a study in a made situation, with the sections of a candidate."""
    units = {"pressure": "kPa", "force": "N"}
    columns = {
        name: {"column": name, "unit": units.get(name, "1")} for name in (*of.inputs, of.target)
    }
    data = {"files": ["*.csv"], "columns": {"time": {"column": "t", "unit": "s"}, **columns}}
    if of.level is not None:
        data["levels"] = {"of": of.level, "at": [1.0, 2.0]}
    sections = {key: each for key, each in candidate.sections.items() if key[:5] != "fuse."}
    fuse = {key[5:]: each for key, each in candidate.sections.items() if key[:5] == "fuse."}
    sections = {**sections, "fuse": fuse} if fuse else sections
    return ExperimentSpec.model_validate(
        {"name": "made", "data": data, "target": {"column": of.target}, **sections}
    )


def test_every_file_of_candidates_is_tried_and_all_that_its_head_says_is_read():
    files = {path.stem: path for path in Path(searching.__file__).parent.glob("families/*.yaml")}
    assert sorted(files) == sorted((*FAMILIES, *ROUNDS))
    for name in files:
        assert {*family(name)} - {"timed", "kind", "fit", "candidates"} == set()


@pytest.mark.parametrize("name", SITUATIONS)
def test_every_candidate_is_a_valid_structure_of_the_inputs(name):
    """With one input beside the level, a structure without that input has nothing to remember."""
    for of in (SITUATIONS[name], replace(SITUATIONS[name], step=None, ordered=True)):
        found = offered(of)
        words = [candidate.words for candidate in found]
        assert len(words) == len(set(words)) >= 2
        assert not re.search(r"[A-Z]{2}", str([one.sections for one in found]))  # no word is left
        faults = {one.words: [*findings(spec_of(one, of))] for one in found}
        assert {words: each for words, each in faults.items() if each} == {}


def order_along_level(candidate, level):
    """The order of a polynomial that has as many coefficients as a structure has functions of the
    level.
    """
    orders = [0]
    for entry in candidate.sections["dictionary"]:
        for kind, settings in entry.items():
            if kind == "terms" or level not in str(settings["of"]):
                continue
            if kind == "products" and "steps" in str(settings):
                orders.append(6)  # squares and products of the level and of two steps
            elif "spline" in f"{kind} {settings}":
                orders.append(6)  # with three knots
            else:
                orders.append(settings["order"])
    return max(orders)


@pytest.mark.parametrize("levels", [2, 3, 4, 5, 6, 8])
def test_no_structure_of_a_table_has_more_bends_along_the_level_than_levels_determine(levels):
    """What a polynomial of order n does between n levels or fewer is arbitrary, and no left-out
    sample shows it: all of them lie at the other levels.
    """
    table = replace(SITUATIONS["map"], curves=levels, samples=2000, ordered=True)
    pooled = [one for one in offered(table) if "segment" in one.sections]
    pooled = [one for one in pooled if one.sections["segment"]["pressure"] == "none"]
    assert pooled
    assert [one.words for one in pooled if order_along_level(one, "pressure") >= levels] == []


def test_terms_grow_with_the_inputs_and_those_of_long_structures_with_the_samples():
    def most_terms(words, **changes):
        of = replace(SITUATIONS["map"], **changes)
        (one,) = (one for one in offered(of) if one.words == words)
        return one.sections["fit"]["max_terms"]

    for inputs, quadratic, splines in (("ab", 6, 12), ("abcdef", 28, 28)):
        changes = {"inputs": tuple(inputs), "level": None}
        assert most_terms("quadratic", **changes) == quadratic
        assert most_terms("cubic splines of a", **changes) == splines
    # one for every forty samples, and 200 at most
    for samples, terms in ((60, 28), (4000, 100), (12_000, 200)):
        assert most_terms("order 5 of the inputs", curves=6, samples=samples) == terms


def test_recordings_whose_levels_are_left_out_in_turn_get_no_delays():
    untimed = replace(SITUATIONS["record"], step=None)
    texts = [str(one.sections["dictionary"]) for one in offered(untimed) if one.family == "longer"]
    assert texts
    assert not any("[k-" in text or "lags" in text for text in texts)


def test_the_structure_of_the_papers_is_tried_wherever_there_are_levels():
    (papers,) = (one for one in offered(SITUATIONS["map"]) if one.family == "papers")
    found = choices_of(papers.sections, WHOLE)
    assert (found.fit.max_terms, found.fuse.transition, found.segment["pressure"]) == (
        1,
        "linear",
        "levels",
    )


@pytest.mark.parametrize("rival", [False, True], ids=["own", "m2_default"])
def test_the_shared_settings_of_muscles_fit_small_maps(rival):
    """Seven pressures at each strain, unevenly spread: an even third of them may hold two."""
    shared = yaml.safe_load((CONFIGS / "_isometric.yaml").read_text(encoding="utf-8"))
    sections = shared["validate"]["against"][0]["set"] if rival else shared
    cuts = {"strain": "levels", **sections["segment"]}
    parts = {"segment": cuts, "dictionary": sections["dictionary"], "fit": sections["fit"]}
    pressure, curves = np.array([0, 60, 90, 120, 130, 400, 600.0]), []
    for strain in (0.0, 0.1, 0.2):
        columns = {"strain": np.full(7, strain), "pressure": pressure}
        columns["force"] = pressure * (1 - 3 * strain)
        curves.append(replace(curve_of(columns, name=f"e{strain}"), level=strain))
    dataset = replace(dataset_of(curves[0].columns, output="force"), curves=tuple(curves))
    part = replace(WHOLE, levels=Levels(of="strain", at=[0.0, 0.1, 0.2]))
    model = refit(choices_of(parts, part), replace(dataset, level="strain"))
    assert np.isfinite(forecast(model, curves[1]).values).all()


def test_constants_copies_and_the_clock_are_no_inputs():
    time = np.arange(100) * 0.01
    u, y = np.sin(time), np.cos(time)
    found = situation_of(
        dataset_of({"time": time, "u": u, "twice": 2 * u + 1, "still": np.ones(100), "y": y})
    )
    assert found.inputs == ("twice",)
    assert found.step == pytest.approx(0.01)
    assert situation_of(dataset_of({"time": time**2, "u": u, "y": y})).step is None


@pytest.mark.parametrize(("samples", "steps"), [(60, None), (61, 60), (200, 199)])
def test_a_past_needs_sixty_steps(samples, steps):
    time = np.arange(samples) * 0.01
    found = situation_of(dataset_of({"time": time, "u": np.sin(time), "y": np.cos(time)}))
    assert (found.timed, found.steps) == (steps is not None, steps or 0)


@pytest.mark.parametrize(
    ("inputs", "most"), [("ab", 28), ("abc", 28), ("abcd", 35), ("abcdef", 84)]
)
def test_a_map_has_at_most_as_many_parameters_as_a_cubic_of_its_inputs(inputs, most):
    found = replace(SITUATIONS["map"], inputs=tuple(inputs))
    assert most_parameters(found) == most
    assert most_parameters(SITUATIONS["many"]) == np.inf


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("measured", ["length", "displacement"])
def test_the_strain_is_an_input_instead_of_the_length_that_it_was_computed_from(measured, order):
    """In whatever order the columns stand: formulas of the literature need the strain."""
    strain = 0.1 + 0.1 * np.sin(0.1 * np.arange(100))
    columns = {measured: 0.069 * (1 - strain), "strain": strain}
    columns = dict([*columns.items()][::order])
    assert situation_of(dataset_of({**columns, "y": strain**2})).inputs == ("strain",)
    dataset = replace(dataset_of({**columns, "y": strain**2}), level=measured)
    with pytest.raises(DataError, match=f"{measured} is the only input"):  # a level stays
        situation_of(dataset)


def test_what_was_computed_from_the_target_is_no_input():
    u = np.sin(0.1 * np.arange(100))
    columns = {"u": u, "hysteresis": u**2, "static_force": u**3, "damping": u**4}
    assert situation_of(dataset_of(columns, output="damping")).inputs == ("u",)


def test_a_level_alone_is_no_input():
    u = np.repeat([1.0, 2.0], 50)
    levels = replace(dataset_of({"u": u[:50], "y": u[:50]}, {"u": u[50:], "y": u[50:]}), level="u")
    with pytest.raises(DataError, match="u is the only input that varies"):
        situation_of(levels)


def test_every_fold_of_a_few_samples_leaves_some_out():
    time = np.arange(40) * 0.01
    columns = {"time": time, "u": np.arange(40) % 2.0, "y": np.arange(40) % 2.0}
    bench = bench_of(dataset_of(columns, held_out=np.arange(40) >= 4))
    assert all(fold.any() for fold in bench.folds)


def test_what_is_held_out_is_not_looked_at():
    time, u = np.arange(100) * 0.01, np.r_[np.linspace(0, 1, 80), np.full(20, 9.0)]
    held_out = np.arange(100) >= 80
    other = np.where(held_out, -50.0, u)
    one, two = (dataset_of({"time": time, "u": of, "y": u}, held_out=held_out) for of in (u, other))
    assert situation_of(one) == situation_of(two)


def test_a_clock_that_no_curve_has_is_no_clock():
    """A study may declare a time that its files do not hold."""
    x = np.arange(100.0)
    whole = dataset_of({"x": x, "y": x})
    declared = replace(whole, quantities={**whole.quantities, "time": whole.quantities["x"]})
    assert situation_of(declared) == situation_of(whole)


def test_bands_of_an_input_are_left_out_where_the_study_holds_some_out():
    """A pressure swept up and down: pieces of the time hold all of its values, and ask for nothing
    between.
    """
    time = np.arange(600) * 0.01
    u = 100 * np.abs((time % 2) - 1)
    held_out = (u >= 40) & (u <= 60)
    whole = dataset_of({"time": time**2, "u": u, "y": u}, held_out=held_out)
    part = replace(WHOLE, held_out=Holdout.model_validate({"u": {"between": [[40, 60]]}}))
    bench = bench_of(whole, part)
    folds, (curve,) = bench.masks[: bench.blocks], bench.dataset.curves
    values = curve.columns["u"]
    assert len(folds) == 5
    assert all(9 < np.ptp(values[fold[0]]) <= 20 for fold in folds)
    assert not any(fold[0][values == end].any() for fold in folds for end in (0, 100))
    assert not any((fold[0] & curve.held_out).any() for fold in folds)


def in_logs(dataset, *logs):
    """A dataset whose recordings are pieces of logs."""
    known = [
        Recording(curve.id, f"{log}.csv", curve.columns, curve.size, {}, log)
        for curve, log in zip(dataset.curves, logs, strict=True)
    ]
    return replace(dataset, recordings=tuple(known))


def recorded(*sizes, held=()):
    """Recordings of some sizes, some of them held out."""
    every = dataset_of(
        *(dict.fromkeys(("time", "u", "y"), np.arange(size) * 0.01) for size in sizes)
    )
    curves = (
        replace(curve, held_out=np.full(curve.size, number in held))
        for number, curve in enumerate(every.curves)
    )
    return replace(every, curves=tuple(curves))


def test_pieces_of_a_log_that_was_cut_are_left_out_together():
    cut = in_logs(recorded(100, 100, 200, 180), "a", "a", "b", "c")
    bench = bench_of(cut)
    assert [[bool(mask.all()) for mask in fold] for fold in bench.masks[bench.blocks :]] == [
        [True, True, False, False],
        [False, False, True, False],
        [False, False, False, True],
    ]
    # the last piece is the end of the log, and so is what is left out
    behind = bench_of(in_logs(recorded(100, 100, 100, held=[2]), "a", "a", "a"))
    assert behind.asks_parts
    assert [[int(mask.sum()) for mask in fold] for fold in behind.masks[behind.blocks :]] == [
        [0, 40],
        [0, 70],
        [0, 100],
    ]


def test_ends_of_the_only_recording_stand_for_another_one():
    """A free run of the recording that is held out begins as that of the only one that trains."""
    bench = bench_of(recorded(200, 200, held=[1]))
    assert [int(fold[0].sum()) for fold in bench.masks[bench.blocks :]] == [40, 70, 100]
    assert bench.asks_parts
    assert bench.weights[bench.blocks :].sum() == pytest.approx(2 / 3)


@pytest.mark.parametrize(
    ("lengths", "held", "out"),
    [
        ((1, 1, 2, 2, 3, 3, 4), 4, [[0, 0, 0, 0, 1, 1]]),  # beyond an end
        ((1, 1, 2, 2, 3, 4), 3, [[0, 0, 1, 1, 0]]),
        ((1, 1, 2, 3), 2, []),  # without one of two values, nothing is learnt of them
        ((1, 2, 2, 3, 3), 2, []),
    ],
)
def test_recordings_at_one_value_of_what_is_held_out_are_left_out_together(lengths, held, out):
    """A value that is new to what trains: by its name, by files or as it comes."""
    of = dict.fromkeys(("time", "u", "y"), np.arange(100) * 0.01)
    every = dataset_of(*({**of, "length": np.full(100, length)} for length in lengths))
    curves = (
        replace(curve, held_out=np.full(100, length == held))
        for curve, length in zip(every.curves, lengths, strict=True)
    )
    bench = bench_of(replace(every, curves=tuple(curves)))
    assert [[mask.all() for mask in fold] for fold in bench.masks[bench.blocks :]] == out


def leveled(*levels, held=()):
    """The bench of a map whose pressures were held, some of them held out."""
    curves = [
        {"p": np.full(20, level), "e": np.linspace(0, 1, 20), "y": np.linspace(0, level, 20)}
        for level in levels
    ]
    found = dataset_of(*curves)
    every = (
        replace(curve, level=level, held_out=np.full(20, level in held))
        for curve, level in zip(found.curves, levels, strict=True)
    )
    return bench_of(replace(found, level="p", curves=tuple(every)))


@pytest.mark.parametrize(
    ("levels", "held", "out", "weight"),
    [
        (3, [], [[2]], 1 / 2),  # the only inner one
        (5, [], [[2], [3], [4]], 1 / 4),
        (10, [], [[2], [3], [5], [6], [8], [9]], 1 / 4),  # six at most
        (5, [3], [[2], [4]], 2 / 3),
        (5, [2, 3], [[4]], 1 / 2),  # of 1, 4 and 5, one is between two others
        (5, [1, 5], [[2], [4]], 1),
        (5, [1, 3], [[2], [4]], 1 / 2 + 1 / 2 * 1 / 2),
        (7, [3, 4], [[2, 5], [5, 6]], 2 / 3),
        (7, [6, 7], [[4, 5], [3, 4, 5]], 1),  # beyond an end: what lies there decides
        (6, [1, 2, 3], [[4]], 1),  # two stay
        # half of it lies beyond an end, and half between levels
        (7, [1, 4], [[2], [2, 3], [3], [5], [6]], 1 / 2 + 1 / 2 * 2 / 3),
    ],
)
def test_levels_are_left_out_as_the_study_holds_them_out(levels, held, out, weight):
    bench = leveled(*range(1, levels + 1), held=held)
    own = [curve.level for curve in bench.dataset.curves]
    stretches, parts = bench.masks[: bench.blocks], bench.masks[bench.blocks :]
    assert [[y for y, mask in zip(own, fold, strict=True) if mask.all()] for fold in parts] == out
    assert bench.weights[bench.blocks :].sum() == pytest.approx(weight)
    assert bench.asks_parts == bool(held)
    # inner ones, without the ends of any curve
    assert len(stretches) == 5
    assert all(m.any() and not m[[0, -1]].any() for fold in stretches for m in fold)


def test_folds_resemble_what_the_study_holds_out():
    time = np.arange(1000) * 0.01

    def folds(held_out):
        columns = {"time": time, "u": np.sin(time), "y": np.where(held_out, 1e9, np.cos(time))}
        return bench_of(dataset_of(columns, held_out=held_out))

    def runs(mask):
        return int((np.diff(np.concatenate([[0], mask.astype(int)])) == 1).sum())

    pieces = folds((np.arange(1000) % 200 >= 160) & (np.arange(1000) < 900))
    assert pieces.blocks == 5
    assert not pieces.asks_parts
    assert all(runs(fold[0]) >= 4 for fold in pieces.masks[:5])
    output = pieces.dataset.curves[0].columns["y"]
    assert np.isnan(output).sum() == 160  # the inputs stay, the outputs do not
    assert np.ptp(pieces.range) <= 4
    assert not any(np.isnan(output[fold[0]]).any() for fold in pieces.masks)

    ends = folds(np.arange(1000) >= 600)
    assert ends.asks_parts
    assert ends.dataset.curves[0].size == 600
    # runs as long as a third at most; the ends
    assert [int(fold[0].sum()) for fold in ends.masks] == [
        *[200] * 5,
        120,
        210,
        300,
    ]
    assert all(runs(fold[0]) == 1 for fold in ends.masks)


def test_a_long_record_is_shortened_to_pieces_as_long_as_the_run_that_is_held_out():
    def pieces(run):
        time = np.arange(40_000) * 0.01
        (curve,) = cut_short(
            dataset_of({"time": time, "u": time, "y": time}), run, step=0.01
        ).curves
        return np.diff(
            np.flatnonzero(np.diff(curve.columns["time"], prepend=-9, append=1e9) > 0.02)
        ).tolist()

    assert pieces(100) == [2400] * 5
    assert pieces(5000) == [6000] * 2
    assert pieces(30_000) == [12_000]


def test_behind_gaps_a_recording_begins_where_its_output_is_known():
    """A model that feeds its output back begins with measured outputs, which are not held out."""
    time = np.arange(1000.0)
    held_out = (time >= 300) & (time < 350) | (time >= 600) & (time < 700)
    columns = {"time": time, "u": np.sin(time), "y": np.cos(time)}
    whole = dataset_of(columns, held_out=held_out)
    gaps = np.isin(time, [650, 680])
    cut = replace(whole, curves=(whole.curves[0].at(~gaps),))
    (curve,) = bench_of(cut).dataset.curves
    expected = np.concatenate([time[:650], time[700:]])  # inputs between training samples stay
    np.testing.assert_array_equal(curve.columns["time"], expected)


@pytest.mark.parametrize(
    ("held", "ends", "weight"),
    [
        ([[0.8, 1]], [(0.6, 0.8)], 1),
        ([[0, 0.3]], [(0.3, 0.53)], 1),  # a third of what trains at most
        ([[0.4, 0.6]], [], 0),
        ([[0.4, 0.5], [0.9, 1]], [(0.8, 0.9)], 1 / 2),  # as much inside as beyond the end
        ([[0.4, 0.42], [0.9, 1]], [(0.8, 0.9)], 1),  # hardly anything inside
    ],
)
def test_an_end_of_an_input_is_left_out_where_the_study_holds_one_out(held, ends, weight):
    x, z = np.random.default_rng(1).random((2, 400))
    held_out = np.any([(x >= low) & (x <= high) for low, high in held], axis=0)
    part = replace(WHOLE, held_out=Holdout.model_validate({"x": {"between": held}}))
    bench = bench_of(dataset_of({"x": x, "z": z, "y": x * z}, held_out=held_out), part)
    values = bench.dataset.curves[0].columns["x"]
    assert bench.weights[bench.blocks :].sum() == pytest.approx(weight, abs=0.1)
    found = [(values[fold].min(), values[fold].max()) for fold in bench.folds[bench.blocks :]]
    assert found == [pytest.approx(end, abs=0.03) for end in ends]


@pytest.mark.parametrize(
    ("levels", "held", "words"),
    [
        (
            6,
            [1, 2, 3],
            "few parameters",
        ),  # the simplest within 20 % at the end, but not worse inside
        (7, [6, 7], "formula's rival"),  # two folds leave an end out, so they decide alone
        (7, [1, 4], "a tenth more at the end, and little inside"),  # half of it lies inside
    ],
)
def test_folds_at_an_end_have_the_weight_of_the_ends_that_are_held_out(levels, held, words):
    bench = leveled(*range(1, levels + 1), held=held)
    sizes = [int(fold.sum()) for fold in bench.folds]
    errors = {  # parameters, error on folds inside, and at the end
        "least at the end": (12, 0.03, 0.1),
        "few parameters": (3, 0.03, 0.11),
        "a tenth more at the end, and little inside": (9, 0.01, 0.11),
        "much more at the end, and less inside": (2, 0.02, 0.13),
        "formula": (20, 0.027, 0.115),
        "formula's rival": (8, 0.04, 0.09),  # one fold says nothing: it is worse inside
    }
    outcomes = []
    for name, (parameters, inside, end) in errors.items():
        at_end = bench.parts_left_out.startswith("each of 2 groups") + 1
        places = [inside] * len(sizes)
        places[bench.blocks : bench.blocks + at_end] = [end] * at_end
        left = [np.full(n, e) for n, e in zip(sizes, places, strict=True)]
        outcomes.append((Tried(name, name, {}, parameters=parameters), left))
    assert choose_structure(outcomes, bench, MOST_PARAMETERS).found.words == words


def test_a_formula_is_not_refused_for_its_error_inside_if_a_single_fold_decides():
    bench = leveled(1, 2, 3, 4, 5, 6, held=[1, 2, 3])
    assert (bench.weights > 0).sum() == 1
    outcomes = []
    for kind, parameters, inside, end in (("formula", 6, 0.09, 0.1), ("simple", 10, 0.03, 0.3)):
        places = np.where(bench.weights > 0, end, inside).tolist()
        left = [np.full(int(fold.sum()), e) for fold, e in zip(bench.folds, places, strict=True)]
        outcomes.append((Tried(kind, kind, {}, parameters=parameters), left))
    assert choose_structure(outcomes, bench, MOST_PARAMETERS).found.words == "formula"


def test_ends_of_all_curves_are_left_out_where_the_study_holds_out_the_end_of_one():
    """The end of a short curve lies within the range of a longer one."""
    u, x = np.ones(100), np.linspace(0, 1, 100)
    whole = dataset_of({"u": u, "x": x, "y": x}, {"u": 2 * u, "x": 2 * x, "y": x})
    short, long = whole.curves
    bench = bench_of(replace(whole, curves=(replace(short, held_out=x > 0.805), long)))
    assert (bench.weights > 0).sum() == 1
    masks = bench.masks[int(np.argmax(bench.weights))]
    left_out = [
        curve.columns["x"][mask] for curve, mask in zip(bench.dataset.curves, masks, strict=True)
    ]
    assert [values.min() for values in left_out] == pytest.approx([0.61, 1.81], abs=0.02)
    assert [values.max() for values in left_out] == pytest.approx([0.80, 2.0], abs=0.02)


def test_the_end_of_a_curve_of_two_values_is_not_left_out():
    """Both values are ends of its range, so that nothing would remain."""
    whole = dataset_of({"x": np.array([0.0, 0.1, 0.2, 0.9]), "y": np.arange(4.0)})
    (curve,) = whole.curves
    held = replace(curve, held_out=np.array([False, False, True, True]))
    with pytest.raises(DataError, match="leaves out training samples, and there are too few"):
        bench_of(replace(whole, curves=(held,)))


def test_structures_are_compared_on_the_rows_that_all_of_them_predict():
    """The root mean square of each over them; infinite where one diverged."""
    one = [np.array([3.0, 100.0, 0.0, 3.0]), np.array([1.0, np.inf])]
    other = [np.array([1.0, np.nan, 1.0, 2.0]), np.array([1.0, 2.0])]
    found = choosing.on_common_rows([one, other])
    assert found[0] == pytest.approx([np.sqrt(6), np.inf])
    assert found[1] == pytest.approx([np.sqrt(2), np.sqrt(2.5)])


@pytest.mark.parametrize(("steps", "taus"), [(199, [1.0, 3.0]), (600, [1.0, 3.0, 10.0, 30.0])])
def test_time_constants_are_at_most_half_of_a_record(steps, taus):
    of = Situation("y", ("u",), None, 500, 1, step=0.1, steps=steps)
    assert vocabulary(of)["DECADES"] == pytest.approx(taus)


@pytest.mark.parametrize(("inputs", "velocities"), [("uv", ["v", "rate(u)"]), ("uvw", ["v"])])
def test_rates_of_at_most_two_moving_inputs_are_velocities(inputs, velocities):
    of = Situation("y", tuple(inputs), None, 500, 1, 0.1, 200, around_zero=("v",))
    assert vocabulary(of)["VELOCITIES"] == velocities


def test_an_input_that_begins_at_zero_is_not_around_it():
    """The input that moves most within a recording comes first."""
    u = np.linspace(0, 1, 20)
    columns = {"u": u, "v": u**2 - 0.5, "w": -(u**3), "y": u + u**2}
    found = situation_of(dataset_of(columns, {**columns, "u": u + 9}))
    assert (found.around_zero, found.inputs) == (("v",), ("v", "w", "u"))


def test_errors_are_fractions_of_the_range_of_the_output_if_it_has_a_range():
    bench = leveled(1, 2, 4)
    still = tuple(
        replace(one, columns={**one.columns, "y": np.full(20, 7.0)}) for one in bench.dataset.curves
    )
    for curves, error in ((bench.dataset.curves, 0.02), (still, 0.08)):
        tried = replace(bench, dataset=replace(bench.dataset, curves=curves))
        left = [np.full(int(fold.sum()), 0.08) for fold in bench.folds]
        found = choose_structure([(Tried("simple", "x", {}, parameters=3), left)], tried, 9)
        assert found.tried[0].error == pytest.approx(error)
