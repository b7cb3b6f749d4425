"""What a run must say loudly: on stderr, on the page, in its document, and again when nothing is left to do."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from cli_samples import hand_model, write_study

from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.validation.residuals import alarms
from mapmore_cli.study.campaigns.batch import Job, run_one

Call = Callable[..., Any]


def reverse_held_out(folder: Path) -> None:
    """The held-out muscle pushes where the others pull."""
    path = folder / "bench_200.csv"
    header, *rows = path.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    path.write_text("\n".join([header, *(f"{p},{e},{-0.5 * float(f)}" for p, e, f in cells)]) + "\n")


WORSE = "worse than the mean of what was measured"
BEYOND_SCALE = "times the full scale (max|force| over validate)"


def test_a_hopeless_model_is_called_so_everywhere(tmp_path: Path, mapmore: Call) -> None:
    spec, runs = write_study(tmp_path), tmp_path / "runs"
    reverse_held_out(tmp_path)
    first = mapmore("run", spec, "--runs", runs, "--json")
    assert first.exit_code == 0, first.stderr
    loud = json.loads(first.stdout)["warnings"]
    for words in (WORSE, BEYOND_SCALE):
        assert sum(words in warning for warning in loud) == 1
        assert f"{words}" in first.stderr
    row = next(r for r in json.loads(first.stdout)["scores"] if (r["model"], r["split"], r["curve"]) == ("mapmore", "validate", "all"))
    assert row["r2"] < 0
    assert row["max_abs_error_fs"] > 1
    again = mapmore("run", spec, "--runs", runs)
    assert "warning: R² on the held-out data is" in again.stderr  # nothing was done, and it is said all the same
    quiet = mapmore("run", spec, "--runs", runs, "--json", "-q")
    assert (quiet.stderr, json.loads(quiet.stdout)["warnings"]) == ("", [w for w in loud if WORSE in w or BEYOND_SCALE in w])
    page = (runs / "bench" / "report" / "index.html").read_text()
    assert page.count('<p class="warning">') == 2
    assert WORSE in page
    shown = mapmore("show", runs / "bench" / "validate.h5", "--json")
    assert json.loads(shown.stdout)["warnings"] == json.loads(quiet.stdout)["warnings"]
    limited = mapmore("run", spec, "--runs", runs, "-q", "--set", "validate.require={r2: 0.5}")
    assert limited.exit_code == 6


def test_extrapolation_is_told_with_its_share(tmp_path: Path, mapmore: Call) -> None:
    spec = write_study(tmp_path)
    text = spec.read_text()
    for held, told in (("[[0.05, 1]]", "all held-out samples lie outside"), ("[[0.03, 0.04], [0.05, 1]]", "held-out samples lie outside")):
        spec.write_text(text.replace("{pressure: [200]}", f"{{strain: {{between: {held}}}}}"))
        result = mapmore("validate", spec, "--runs", tmp_path / "runs", "--json", "-q")
        assert result.exit_code == 0, result.stderr
        loud = [warning for warning in json.loads(result.stdout)["warnings"] if "outside of the training range" in warning]
        assert len(loud) == 1
        assert told in loud[0]


def test_a_good_model_is_not_warned_of(tmp_path: Path, mapmore: Call) -> None:
    result = mapmore("validate", write_study(tmp_path), "--runs", tmp_path / "runs", "--json", "-q")
    assert json.loads(result.stdout)["warnings"] == []


def test_pieces_that_add_nothing_are_told(tmp_path: Path, mapmore: Call) -> None:
    spec = write_study(tmp_path)
    for level in (100, 200, 300):  # the formula exactly
        strain = np.linspace(0.0, 0.1, 24)
        lines = [f"{level},{e!r},{level * (3 * (1 - e) ** 2 - 1)!r}" for e in strain.tolist()]
        (tmp_path / f"bench_{level}.csv").write_text("\n".join(["P,eps,F", *lines]) + "\n")
    spec.write_text(spec.read_text() + "model: {backbone: chou_hannaford}\n")
    result = mapmore("validate", spec, "--runs", tmp_path / "runs", "--json", "-q")
    told = "the model says the same as its backbone chou_hannaford, on every sample: its pieces add nothing"
    assert json.loads(result.stdout)["warnings"][0] == told


def test_dropped_pieces_are_told() -> None:
    parameters = {"a": 3.0, "b": 1.0}
    formula = FormulaFit("chou_hannaford", parameters, parameters, "converged", "linear least squares", 2, 1.0, 0.0, 9)
    model = hand_model()
    bare = tuple(replace(curve, segments=()) for curve in model.body.curves)
    dropped = replace(model, body=replace(model.body, curves=bare, backbone=formula))
    curve = Curve("c", None, {name: np.ones(2) for name in ("pressure", "strain", "force")}, np.zeros(2, dtype=bool), ("c",))
    dataset = Dataset("force", None, {}, (), (curve,))
    (told,) = alarms(dropped, dataset, (np.ones(2),), ())
    assert told.startswith("the model says the same as its backbone chou_hannaford, because its pieces were dropped")
    assert not alarms(model, dataset, (np.ones(2),), ())


def test_a_run_of_a_batch_has_them_first(tmp_path: Path) -> None:
    spec = write_study(tmp_path)
    reverse_held_out(tmp_path)
    assert WORSE in run_one(Job(spec, tmp_path / "runs")).warnings[0]
