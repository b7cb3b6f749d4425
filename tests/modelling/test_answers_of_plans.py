"""What a person gives to `plan` and `tune`, and how trials are compared."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from common import dataset_of

from mapmore_cli.annexes.planning import commands, planning, tuning
from mapmore_cli.annexes.planning.commands import _prices_of, _values_of
from mapmore_cli.annexes.planning.planning import _size_of
from mapmore_cli.annexes.planning.results import Candidate, Trial
from mapmore_cli.annexes.planning.tuning import _ranked
from mapmore_cli.domain.errors import FitError, UsageError
from mapmore_cli.reporting.table import Table


def test_prices_are_above_zero():
    assert _prices_of("pressure=1, strain = 2.5") == {"pressure": 1, "strain": 2.5}
    assert _prices_of(None) == _prices_of("") == {}
    for text in ("pressure", "pressure=x", "pressure=0", "pressure=-1", "a=inf", "a=nan", "a=1,b"):
        with pytest.raises(UsageError, match=r"--cost .* is not of the form"):
            _prices_of(text)


def test_values_of_settings_are_yaml():
    values = _values_of(["fit.max_terms=2,4", " fit.stop =bic", "a=[1, 2],true"])
    assert values == {"fit.max_terms": [2, 4], "fit.stop": ["bic"], "a": [[1, 2], True]}
    for text in ("fit", "=1", "fit.=1", "a=", "a=1]"):
        with pytest.raises(UsageError, match="--over") as refused:
            _values_of([text])
        assert not re.search(r":\d", refused.value.message), "an option has no lines"
    with pytest.raises(UsageError, match="given twice"):
        _values_of(["a=1", "a=2"])


def test_sizes_are_numbers_or_shares_of_the_largest_value():
    sizes = [_size_of(text, 300.0) for text in ("2%", " 0.5 % ", "4", "1e-3")]
    assert sizes == pytest.approx([6, 1.5, 4, 1e-3])
    for text in ("", "%", "0", "-2%", "inf", "nan", "2 N"):
        with pytest.raises(UsageError, match="--until"):
            _size_of(text, 300.0)


@pytest.mark.parametrize(("kind", "until"), [("auto", "fuse"), ("pieces", "ingest")])
def test_a_structure_is_searched_before_the_plan_and_everything_else_is_only_read(
    kind, until, monkeypatch
):
    calls = []
    loaded = SimpleNamespace(spec=SimpleNamespace(model=SimpleNamespace(type=kind), name="a"))
    columns = {"strain": np.array([0.0, 0.1]), "y": np.array([50.0, -200.0])}
    dataset = dataset_of(columns)
    files = SimpleNamespace(dataset=lambda: dataset)
    result = (Candidate({"strain": 0.1}, "point"),), None, None, ()

    def planned(_choices, _whole, count, wanted, _prices):
        calls.append((count, wanted))
        return result

    def bring(_loaded, _runs, stage):
        calls.append(stage)
        return SimpleNamespace(run_dir=Path())

    monkeypatch.setattr(planning, "bring_up_to_date", bring)
    monkeypatch.setattr(planning, "as_found", lambda loaded, _: loaded)
    monkeypatch.setattr(planning, "_plannable", lambda _: calls.append("checked"))
    monkeypatch.setattr(planning, "RunFiles", lambda _: files)
    monkeypatch.setattr(planning, "of_points", planned)
    monkeypatch.setattr(planning, "_of_levels", lambda *_: calls.append("levels") or result)

    def plan(points=None, until=None):
        return planning.plan(loaded, Path(), points=points, until=until, prices={})

    made = plan()
    before = ["checked"] if until == "ingest" else []
    assert calls == [*before, until, "checked", (5, None)]
    assert (made.largest, [*made.quantities]) == (200, ["strain"])
    plan(points=7, until="2%")
    assert calls[-1] == (7, 4.0)
    dataset = replace(dataset, level="strain")
    plan()
    assert calls[-1] == "levels"
    with pytest.raises(UsageError, match="--until"):
        plan(until="2%")
    plan(points=3, until="1")
    assert calls[-1] == (3, 1)


def trial(parameters, *errors, failure=""):
    return Trial({"a": parameters}, parameters, errors, failure=failure)


def test_trials_are_compared_with_the_best_and_the_simplest_as_good_is_chosen():
    folds = SimpleNamespace(left_out="level", full_scale="range")
    failed = trial(9, failure="singular")
    trials = [failed, trial(5, 1.0, 2.0, 4.0), trial(2, 1.1, 1.9, 4.1), trial(1, 9.0, 9.0, 9.0)]
    tuned = _ranked("study", folds, trials)
    assert (tuned.name, tuned.left_out, tuned.full_scale) == ("study", "level", "range")
    assert (tuned.best.parameters, tuned.chosen.parameters) == (5, 2)
    assert [each.parameters for each in tuned.trials] == [9, 5, 2, 1]
    assert tuned.trials[0] is failed
    assert tuned.best.excess == 0
    logs = np.log([1.1, 0.95, 4.1 / 4])
    assert tuned.chosen.excess == pytest.approx(logs.mean())
    assert tuned.chosen.spread == pytest.approx(logs.std(ddof=1) / np.sqrt(3))
    with pytest.raises(FitError, match=r"study: no combination could be fitted .*: singular"):
        _ranked("study", folds, [failed])


@pytest.mark.parametrize(
    ("errors", "failure"),
    [((1.0, 4.0), ""), ((1.0, np.nan, np.inf), "no finite prediction on 2 of 3 folds")],
)
def test_a_combination_is_tried_on_every_fold(monkeypatch, errors, failure):
    monkeypatch.setattr(tuning, "refit", lambda choices, dataset: (choices, dataset))
    monkeypatch.setattr(tuning, "parameters", lambda model: len(model))
    monkeypatch.setattr(tuning, "errors_of", lambda folds, fit: fit(()) and folds.errors)
    folds = SimpleNamespace(dataset="d", errors=errors)
    tried = tuning._try_settings({"a": 1}, "choices", folds)
    assert (tried.settings, tried.parameters, tried.failure) == ({"a": 1}, 2, failure)
    assert tried.errors == (() if failure else errors)
    assert failure or tried.error == pytest.approx(2)  # the geometric mean

    def refuse(*_):
        raise FitError("is singular")

    monkeypatch.setattr(tuning, "refit", refuse)
    assert tuning._try_settings({}, "choices", folds) == Trial({}, failure="is singular")


@pytest.mark.parametrize(
    ("levels", "each", "held", "by_level"),
    [
        (None, True, None, False),
        ("pressure", False, None, False),
        ("pressure", True, None, True),
        ("pressure", False, ("pressure",), True),
        ("pressure", False, ("time",), False),
    ],
)
def test_levels_are_left_out_if_the_study_holds_out_levels(
    levels, each, held, by_level, monkeypatch
):
    hold_out = None if held is None else SimpleNamespace(quantities=held)
    data = SimpleNamespace(
        split=SimpleNamespace(leave_one_level_out=each, hold_out=hold_out),
        levels=None if levels is None else SimpleNamespace(of=levels),
    )
    validation = SimpleNamespace(normaliser="max")
    loaded = SimpleNamespace(spec=SimpleNamespace(data=data, validation=validation, name="a"))
    nothing = lambda *_, **__: SimpleNamespace(run_dir=Path())  # noqa: E731
    for name in ("refuse_several_targets", "bring_up_to_date", "model_choices"):
        monkeypatch.setattr(tuning, name, nothing)
    monkeypatch.setattr(tuning, "RunFiles", lambda _: SimpleNamespace(dataset=lambda: None))
    monkeypatch.setattr(tuning, "training_only", nothing)
    monkeypatch.setattr(tuning, "_variants", lambda *_: [])
    monkeypatch.setattr(tuning, "shared_out", lambda *_: [])
    monkeypatch.setattr(tuning, "folds_of", lambda *of: of)
    monkeypatch.setattr(tuning, "_ranked", lambda _name, folds, _trials: folds)
    assert tuning.tune(loaded, {}, Path(), progress=print)[2:] == ("max", by_level)


def test_tables_and_drawings_are_written_by_their_endings(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(commands, "write_figure", lambda path, figure: drawn.append((path, figure)))
    monkeypatch.setattr("mapmore_cli.annexes.planning.drawing.drawing_of", lambda result: result)
    table = Table.of("t", "T", ("a",), [(1.5,)])
    paths = [tmp_path / name for name in ("a.csv", "a.tex", "a.svg")]
    commands.write_results(paths, table, "result")
    assert drawn == [(tmp_path / "a.svg", "result")]
    assert (tmp_path / "a.csv").read_text().splitlines() == ["a", "1.5"]
    assert "tabular" in (tmp_path / "a.tex").read_text()
