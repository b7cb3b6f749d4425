"""`run` and the stage commands on a real study: results on stdout, everything else on stderr."""

import json
import re
import shlex
from dataclasses import fields
from html import unescape
from pathlib import Path

import pytest
from cli_samples import OWN, by_place, edit

from mapmore_cli.domain.scores import Score

STAGES = ["ingest", "segment", "fit", "fuse", "validate", "report"]


def test_run_prints_scores_beside_the_published_ones_and_the_page(study, mapmore):
    result = mapmore("run", study, code=0)
    lines = [line.split(":")[0] for line in result.stderr.splitlines()]
    assert [line for line in lines if line != "warning"] == STAGES
    assert "published NRMSE" in result.stdout
    assert "2.2" in result.stdout
    page = Path("runs", "bench", "report", "index.html")
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
    stages = [line for line in result.stderr.splitlines() if not line.startswith("warning: ")]
    assert stages == [f"{stage}: up to date" for stage in STAGES]


def test_what_speaks_against_the_number_is_said_in_the_same_words_everywhere(
    finished, mapmore, document
):
    spec, runs = finished
    alerts = document("run", spec, "--runs", runs, "-q")["alerts"]
    assert {"few curves", "competitor"} <= {alert["kind"] for alert in alerts}
    sentences = [alert["sentence"] for alert in alerts]
    lines = mapmore("run", spec, "--runs", runs).stderr.splitlines()
    assert [line for line in lines if line.startswith("warning")] == [
        f"warning: {sentence}" for sentence in sentences
    ]
    page = unescape((runs / "bench" / "report" / "index.html").read_text())
    places = [page.index(f">{sentence}</a>") for sentence in sentences]
    assert places == sorted(places)


def test_the_page_says_how_to_make_the_run_again(finished):
    spec, runs = finished
    page = unescape((runs / "bench" / "report" / "index.html").read_text())
    command = re.search(r'<code data-copy="the command">(.*?)</code>', page)[1]
    assert command.startswith("mapmore run ")
    assert (runs.parent / shlex.split(command)[2]).resolve() == Path(spec).resolve()
    record = json.loads((runs / "bench" / "run.json").read_text())
    for stamp in record["stages"]["ingest"]["inputs"].values():
        assert stamp["sha256"] in page


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
        "alerts",
    ]
    assert (run["name"], run["run_dir"]) == ("bench", str(runs / "bench"))
    assert run["stages"] == dict.fromkeys(STAGES, "up-to-date")
    stored = json.loads((runs / "bench" / "scores.json").read_text())
    assert (run["scores"], run["units"]) == (stored["scores"], stored["units"])
    assert run["units"] == {run["scores"][0]["target"]: "N"}
    assert all(list(row) == [field.name for field in fields(Score)] for row in run["scores"])
    rows = by_place(run)
    assert {("polynomial_2", "train", "all"), ("mapmore", "train", "pressure=300")} <= {*rows}
    assert rows[OWN]["nrmse"] == pytest.approx(rows[OWN]["rmse"] / rows[OWN]["normaliser"])
    assert 0 < rows[OWN]["nrmse"] < 0.02  # a fraction, and the study is an easy one


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


def test_the_figures_that_are_asked_for_are_drawn_alone(study, mapmore):
    page = study.parent / "runs" / "bench" / "report" / "index.html"
    for names, least, most in (("none", 0, 0), ("nrmse,error", 2, 2), ("all", 6, 99)):
        mapmore("report", study, "--figures", names, code=0)
        assert least <= page.read_text().count("<figcaption>") <= most


def test_a_stage_brings_those_before_it_up_to_date_and_says_why(study, mapmore):
    runs = study.parent / "runs"
    mapmore("fit", study, code=0)
    again = mapmore("fit", study, "--set", "fit.max_terms=2")
    assert again.stderr.splitlines() == [
        "ingest: up to date",
        "segment: up to date",
        "fit: runs (fit.max_terms: 1 -> 2)",
    ]
    assert not (runs / "bench" / "model.h5").exists()


def test_verbose_says_how_long_each_stage_took_and_force_redoes_it(study, mapmore):
    arguments = ("segment", study)
    lines = mapmore(*arguments, "-v").stderr.splitlines()
    assert [line.split(" in ")[0] for line in lines] == [
        "ingest: runs (first time)",
        "ingest: done",
        "segment: runs (first time)",
        "segment: done",
    ]
    assert mapmore(*arguments, "--force").stderr.splitlines() == [
        "ingest: runs (forced)",
        "segment: runs (forced)",
    ]


def test_explain_says_why_and_does_nothing(finished, mapmore, document):
    spec, runs = finished
    before = {path: path.stat().st_mtime_ns for path in runs.rglob("*")}
    explained = (spec, "--runs", runs, "--set", "fuse.z_s=0.1", "--explain")
    told = document("run", *explained, "-q")["stages"]
    assert (told["fit"], told["fuse"]) == (None, "fuse.z_s: 0.25 -> 0.1")
    assert told["report"] is not None
    assert "fuse.z_s: 0.25 -> 0.1" in mapmore("fuse", *explained).stdout
    assert {path: path.stat().st_mtime_ns for path in runs.rglob("*")} == before


def test_printed_spec_is_a_spec_with_the_overrides(study, mapmore, document):
    printed = mapmore("run", study, "--set", "fuse.z_s=0.125", "--print-spec")
    assert (printed.exit_code, printed.stderr) == (0, "")
    assert "z_s: 0.125" in printed.stdout
    assert not (study.parent / "runs").exists()
    copy = study.with_name("copy.yaml")
    copy.write_text(printed.stdout)
    assert mapmore("run", copy, "--print-spec").stdout == printed.stdout


def test_guesses_that_nobody_confirmed_are_counted(study, mapmore):
    edit(study, "target: static", "target: static  # CHECK: is it?")
    mapmore("ingest", study, code=0, says="1 guess of the spec is not confirmed")
