"""How commands tell machines and people what came of them: errors, missed limits, warnings that
must be loud.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from cli_samples import change_forces, hand_model, write_study

from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.validation.residuals import alarms
from mapmore_cli.pipeline.jobs import Job, run_one


def test_a_missed_limit_stands_in_the_document_of_a_run(tmp_path, mapmore):
    spec = write_study(tmp_path)
    arguments = (
        "run",
        spec,
        "--runs",
        tmp_path / "runs",
        "-q",
        "--json",
        "--set",
        "validate.require={nrmse: 1e-9, r2: 0.5}",
    )
    result = mapmore(
        *arguments, "--junit", tmp_path / "junit.xml", "--summary", tmp_path / "summary.md", code=6
    )
    document = json.loads(result.stdout)  # one document, also where the limit is missed
    assert [sentence.split()[0] for sentence in document["missed"]] == ["nrmse"]
    cases = {case.get("name"): case for case in ET.parse(tmp_path / "junit.xml").iter("testcase")}
    assert set(cases) == {"run", "require nrmse", "require r2"}
    assert cases["require nrmse"].find("failure") is not None
    assert cases["require r2"].find("failure") is None
    summary = (tmp_path / "summary.md").read_text()
    assert summary.startswith("## mapmore: 0 of 1 runs in order")
    assert "| mapmore | validate |" in summary


def test_errors_are_json_too(tmp_path, mapmore):
    spec = write_study(tmp_path)
    settings = ("--set", "data.files=[none_*.csv]", "--junit", tmp_path / "j.xml")
    result = mapmore("run", spec, "--runs", tmp_path / "runs", "--json", "-q", *settings, code=4)
    error = json.loads(result.stdout)["error"]
    assert error["exit_code"] == 4
    assert "none_*.csv" in error["message"]
    assert error["remedy"]
    assert "error: " in result.stderr
    case = next(ET.parse(tmp_path / "j.xml").iter("testcase"))
    assert case.find("error") is not None
    assert mapmore("show", tmp_path / "nothing.h5").stdout == ""
    assert (
        json.loads(mapmore("show", tmp_path / "nothing.h5", "--json").stdout)["error"]["exit_code"]
        == 4
    )


def test_a_warning_of_many_runs_is_told_once(tmp_path, mapmore):
    spec = write_study(tmp_path)
    others = ", ".join(
        f"{{set: {{segment.strain.min_samples: {least}}}, as: {name}}}"
        for least, name in ((30, "one"), (31, "two"))
    )
    cuts = "segment.strain={method: even, count: 4, min_samples: 29}"
    result = mapmore(
        "run",
        spec,
        "--runs",
        tmp_path / "runs",
        "--set",
        cuts,
        "--set",
        f"validate.against=[{others}]",
        code=0,
    )
    warnings = [
        line
        for line in result.stderr.splitlines()
        if "curve pressure=300: 1 segment(s) along strain instead of 4" in line
    ]
    assert len(warnings) == 1
    assert "(the same in 3 runs: bench.one, bench.two)" in warnings[0]


def test_what_was_read_for_all_variations_is_told_once(tmp_path, mapmore):
    spec = write_study(tmp_path)
    (tmp_path / "bench_300.csv").write_text(
        "\n".join((tmp_path / "bench_300.csv").read_text().splitlines()[:10]) + "\n"
    )
    result = mapmore(
        "run",
        spec,
        "--runs",
        tmp_path / "runs",
        "--set",
        "validate.against=[{set: {fit.max_terms: 1}, as: one}]",
        code=0,
    )
    assert result.stderr.count("holds only 9 samples") == 1


def test_a_level_that_was_measured_at_one_place_is_cut_into_one_segment(tmp_path, mapmore):
    spec = write_study(tmp_path)
    rows = [f"300,0.1,{380 + repeat}" for repeat in (-1, 0, 1)]
    (tmp_path / "bench_300.csv").write_text("\n".join(["P,eps,F", *rows]) + "\n")
    mapmore(
        "run",
        spec,
        "--runs",
        tmp_path / "runs",
        "--set",
        "segment.strain={method: even, count: 2}",
        code=0,
    )
    table = mapmore(
        "predict",
        tmp_path / "runs/bench/model.h5",
        "--grid",
        "pressure=300:300:1,strain=0.1:0.1:1",
        "-o",
        "-",
    ).stdout
    assert float(table.splitlines()[1].split(",")[2]) == pytest.approx(380)


def reverse_held_out(folder):
    """The held-out muscle pushes where the others pull."""
    change_forces(folder / "bench_200.csv", lambda force: -0.5 * force)


WORSE = "worse than the mean of what was measured"
BEYOND_SCALE = "times the full scale (max|force| over validate)"


def test_a_hopeless_model_is_called_so_everywhere(tmp_path, mapmore):
    spec, runs = write_study(tmp_path), tmp_path / "runs"
    reverse_held_out(tmp_path)
    first = mapmore("run", spec, "--runs", runs, "--json", code=0)
    loud = json.loads(first.stdout)["warnings"]
    for words in (WORSE, BEYOND_SCALE):
        assert sum(words in warning for warning in loud) == 1
        assert f"{words}" in first.stderr
    row = next(
        r
        for r in json.loads(first.stdout)["scores"]
        if (r["model"], r["split"], r["curve"]) == ("mapmore", "validate", "all")
    )
    assert row["r2"] < 0
    assert row["max_abs_error_fs"] > 1
    again = mapmore("run", spec, "--runs", runs)
    assert (
        "warning: R² on the held-out data is" in again.stderr
    )  # nothing was done, and it is said all the same
    quiet = mapmore("run", spec, "--runs", runs, "--json", "-q")
    assert (quiet.stderr, json.loads(quiet.stdout)["warnings"]) == (
        "",
        [w for w in loud if WORSE in w or BEYOND_SCALE in w],
    )
    page = (runs / "bench" / "report" / "index.html").read_text()
    assert page.count('<p class="warning">') == 2
    assert WORSE in page
    shown = mapmore("show", runs / "bench" / "validate.h5", "--json")
    assert json.loads(shown.stdout)["warnings"] == json.loads(quiet.stdout)["warnings"]
    mapmore("run", spec, "--runs", runs, "-q", "--set", "validate.require={r2: 0.5}", code=6)


def test_extrapolation_is_told_with_its_share(tmp_path, document):
    spec = write_study(tmp_path)
    text = spec.read_text()
    for held, told in (
        ("[[0.05, 1]]", "all held-out samples lie outside"),
        ("[[0.03, 0.04], [0.05, 1]]", "held-out samples lie outside"),
    ):
        spec.write_text(text.replace("{pressure: [200]}", f"{{strain: {{between: {held}}}}}"))
        warnings = document("validate", spec, "--runs", tmp_path / "runs", "-q")["warnings"]
        assert [
            told in warning for warning in warnings if "outside of the training range" in warning
        ] == [True]


def test_a_good_model_is_not_warned_of(tmp_path, document):
    assert (
        document("validate", write_study(tmp_path), "--runs", tmp_path / "runs", "-q")["warnings"]
        == []
    )


def test_pieces_that_add_nothing_are_told(tmp_path, document):
    spec = write_study(tmp_path)
    for level in (100, 200, 300):  # the formula exactly
        strain = np.linspace(0.0, 0.1, 24)
        lines = [f"{level},{e!r},{level * (3 * (1 - e) ** 2 - 1)!r}" for e in strain.tolist()]
        (tmp_path / f"bench_{level}.csv").write_text("\n".join(["P,eps,F", *lines]) + "\n")
    spec.write_text(spec.read_text() + "model: {backbone: chou_hannaford}\n")
    told = (
        "the model says the same as its backbone chou_hannaford, on every sample: its pieces "
        "add nothing"
    )
    assert document("validate", spec, "--runs", tmp_path / "runs", "-q")["warnings"][0] == told


def test_dropped_pieces_are_told():
    parameters = {"a": 3.0, "b": 1.0}
    formula = FormulaFit(
        "chou_hannaford",
        parameters,
        parameters,
        "converged",
        "linear least squares",
        2,
        1.0,
        0.0,
        9,
    )
    model = hand_model()
    bare = tuple(replace(curve, segments=()) for curve in model.body.curves)
    dropped = replace(model, body=replace(model.body, curves=bare, backbone=formula))
    curve = Curve(
        "c",
        None,
        {name: np.ones(2) for name in ("pressure", "strain", "force")},
        np.zeros(2, dtype=bool),
        ("c",),
    )
    dataset = Dataset("force", None, {}, (), (curve,))
    (told,) = alarms(dropped, dataset, (np.ones(2),), ())
    assert told.startswith(
        "the model says the same as its backbone chou_hannaford, because its pieces were dropped"
    )
    assert not alarms(model, dataset, (np.ones(2),), ())


def test_a_run_of_a_batch_has_them_first(tmp_path):
    spec = write_study(tmp_path)
    reverse_held_out(tmp_path)
    assert WORSE in run_one(Job(spec, tmp_path / "runs")).warnings[0]
