"""`run` and the stage commands on a real study: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import pytest

from mapmore_cli.domain.scores import Score

STAGES = ["ingest", "segment", "fit", "fuse", "validate", "report"]


def test_run_prints_scores_beside_the_published_ones_and_the_page(study, mapmore):
    runs = study.parent / "runs"
    result = mapmore("run", study, "--runs", runs, code=0)
    assert [line.split(":")[0] for line in result.stderr.splitlines()] == STAGES
    assert "published NRMSE" in result.stdout
    assert "2.2" in result.stdout
    page = runs / "bench" / "report" / "index.html"
    assert result.stdout.endswith(f"page: {page}\n")
    assert page.is_file()


def test_tables_are_neither_coloured_nor_cut_off_in_a_pipe(finished, mapmore, monkeypatch):
    spec, runs = finished
    monkeypatch.setenv("COLUMNS", "20")
    result = mapmore("run", spec, "--runs", runs, "-q")
    assert "\x1b" not in result.stdout
    assert "…" not in result.stdout
    assert max(map(len, result.stdout.splitlines())) > 80


def test_second_run_does_nothing_and_says_so(finished, mapmore):
    spec, runs = finished
    result = mapmore("run", spec, "--runs", runs)
    assert result.stderr.splitlines() == [f"{stage}: up-to-date" for stage in STAGES]


def test_json_has_the_promised_shape(finished, document):
    spec, runs = finished
    run = document("run", spec, "--runs", runs, "-q")
    assert list(run) == [
        "name",
        "run_dir",
        "stages",
        "scores",
        "units",
        "missed",
        "warnings",
        "unconfirmed",
    ]
    assert run["name"] == "bench"
    assert run["run_dir"] == str(runs / "bench")
    assert run["stages"] == dict.fromkeys(STAGES, "up-to-date")
    assert run["units"] == {run["scores"][0]["target"]: "N"}
    assert all(list(row) == [field.name for field in fields(Score)] for row in run["scores"])
    places = {(row["model"], row["split"], row["curve"]) for row in run["scores"]}
    assert {
        ("mapmore", "validate", "all"),
        ("polynomial_2", "train", "all"),
        ("mapmore", "train", "pressure=300"),
    } <= places
    own = next(
        row
        for row in run["scores"]
        if (row["model"], row["split"], row["curve"]) == ("mapmore", "validate", "all")
    )
    assert own["nrmse"] == pytest.approx(own["rmse"] / own["normaliser"])
    assert 0 < own["nrmse"] < 0.02  # a fraction, and the study is an easy one
    stored = json.loads((runs / "bench" / "scores.json").read_text())
    assert (run["scores"], run["units"]) == (stored["scores"], stored["units"])


@pytest.mark.parametrize(
    ("stage", "key"),
    [
        ("ingest", "curves"),
        ("segment", "curves"),
        ("fit", "segments"),
        ("fuse", "weights"),
        ("validate", "scores"),
        ("report", "files"),
    ],
)
def test_stage_commands_print_their_stage(stage, key, finished, document, mapmore):
    spec, runs = finished
    told = document(stage, spec, "--runs", runs, "-q")
    assert list(told)[:3] == ["name", "run_dir", "stages"]
    assert list(told["stages"]) == STAGES[: STAGES.index(stage) + 1]
    assert told[key]
    for_people = mapmore(stage, spec, "--runs", runs, "-q")
    assert for_people.stderr == ""
    assert ("index.html" if stage == "report" else "---") in for_people.stdout


def test_a_stage_brings_those_before_it_up_to_date_and_says_why(study, mapmore):
    runs = study.parent / "runs"
    mapmore("fit", study, "--runs", runs, code=0)
    again = mapmore("fit", study, "--runs", runs, "--set", "fit.max_terms=2")
    assert again.stderr.splitlines() == [
        "ingest: up-to-date",
        "segment: up-to-date",
        "fit: fit.max_terms: 1 -> 2",
    ]
    assert not (runs / "bench" / "model.h5").exists()


def test_verbose_says_how_long_each_stage_took_and_force_redoes_it(study, mapmore):
    arguments = ("segment", study, "--runs", study.parent / "runs")
    lines = mapmore(*arguments, "-v").stderr.splitlines()
    assert [line.split(" in ")[0] for line in lines] == [
        "ingest: never ran",
        "ingest: done",
        "segment: never ran",
        "segment: done",
    ]
    assert mapmore(*arguments, "--force").stderr.splitlines() == [
        "ingest: forced",
        "segment: forced",
    ]


def test_explain_says_why_and_does_nothing(finished, mapmore, document):
    spec, runs = finished
    before = {path: path.stat().st_mtime_ns for path in runs.rglob("*")}
    told = document("run", spec, "--runs", runs, "--set", "fuse.z_s=0.1", "--explain", "-q")
    assert told["stages"]["fit"] is None
    assert told["stages"]["fuse"] == "fuse.z_s: 0.25 -> 0.1"
    assert told["stages"]["report"] is not None
    assert (
        "fuse.z_s: 0.25 -> 0.1"
        in mapmore("fuse", spec, "--runs", runs, "--set", "fuse.z_s=0.1", "--explain").stdout
    )
    assert {path: path.stat().st_mtime_ns for path in runs.rglob("*")} == before


def test_printed_spec_is_a_spec_with_the_overrides(study, mapmore, document):
    printed = mapmore("run", study, "--set", "fuse.z_s=0.125", "--print-spec")
    assert (printed.exit_code, printed.stderr) == (0, "")
    assert "z_s: 0.125" in printed.stdout
    assert not (study.parent / "runs").exists()
    copy = study.with_name("copy.yaml")
    copy.write_text(printed.stdout)
    assert mapmore("run", copy, "--print-spec").stdout == printed.stdout


@pytest.mark.parametrize("command", ["run", "validate"])
def test_a_missed_limit_shows_after_the_results(command, study, mapmore):
    runs: Path = study.parent / "runs"
    result = mapmore(
        command, study, "--runs", runs, "--set", "validate.require.nrmse=1e-9", "-q", code=6
    )
    assert "all curves pooled" in result.stdout
    assert "nrmse of mapmore on the validate rows" in result.stderr
    assert (runs / "bench" / "scores.json").is_file()
    kept = mapmore(command, study, "--runs", runs, "--set", "validate.require.nrmse=0.5", "-q")
    assert (kept.exit_code, kept.stderr) == (0, "")
