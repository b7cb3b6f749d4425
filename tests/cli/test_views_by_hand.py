"""What commands print of comparisons, checks and errors, by hand."""

import errno
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cli_samples import CHANGED, CURVES
from common import dataset_of

from mapmore_cli.checking.findings import Issue
from mapmore_cli.cli import console
from mapmore_cli.cli.compared import of_campaign, of_campaigns, of_comparisons, of_inspection
from mapmore_cli.cli.console import print_document, settle, spec_of
from mapmore_cli.cli.views import _memory_tables, of_dataset, of_stage
from mapmore_cli.domain.errors import DataError, UsageError, WriteError
from mapmore_cli.pipeline.inspection import Inspection
from mapmore_cli.storage import run_record
from mapmore_cli.storage.run_record import Origin

SIZE = "torque is 1.0560 times that of old (95 % interval 1.0500 to 1.0620, 2 curves)"
SAME = replace(CHANGED, ratio=1.0, interval=(0.985, 1.015), narrow=(0.99, 1.01))
WITHIN = "torque is 1.0000 times that of old (95 % interval 0.9850 to 1.0150, 2 curves)"
UNCLEAR = "The data cannot show whether new has changed by more than 2 %: "


@pytest.mark.parametrize(
    ("comparison", "sentence"),
    [
        (CHANGED, f"new has changed: {SIZE}. The largest effect is at p=2: +7.5 Nm at strain 0.1, "
                  "pressure 2."),
        (replace(CHANGED, same_recordings=True), "new was made from the same recordings as old: a "
                  f"difference comes from the settings, not from the muscle: {SIZE}."),
        (SAME, f"new is the same within 2 %: {WITHIN}; two one-sided tests show this (90 % "
               "interval 0.9900 to 1.0100)."),
        (replace(CHANGED, resolution=0.06), f"{UNCLEAR}{SIZE}; a change of less than 6 % cannot be "
                                            "detected with these data."),
        (replace(CHANGED, resolution=1.0), f"{UNCLEAR}{SIZE}; the curves contain no information "
                                           "about it."),
    ],
)  # fmt: skip
def test_the_answer_of_a_comparison(comparison, sentence):
    shown = of_comparisons(["old", "new"], [comparison])
    assert shown.lines == (sentence,)
    assert (shown.document["before"], shown.document["after"]) == ("old", "new")
    assert shown.document["interval_90"] == comparison.narrow
    assert [term["moved"] for term in shown.document["terms"]] == [True]
    assert ("campaigns" in shown.document, len(shown.tables)) == (False, 1)


def test_cautions_about_a_comparison():
    heavy = (replace(CURVES[0], weight=0.67), replace(CURVES[1], weight=0.33, interpolated=True))
    doubtful = replace(CHANGED, curves=heavy, settings=("fit.max_terms: 1 -> 2", "fuse: a -> b"))
    shown = of_comparisons(["old", "mid", "new"], [SAME, doubtful])
    assert shown.lines[1:] == (
        "The settings differ: fit.max_terms: 1 -> 2; fuse: a -> b.",
        "67 % of the weight lies on one curve, p=1: the result describes mainly this curve.",
        "The levels of the two models differ, so that one of them is interpolated between its "
        "curves.",
    )
    later = [(each["after"], each["answer"]) for each in shown.document["campaigns"]]
    assert (later, len(shown.tables)) == ([("mid", "same"), ("new", "changed")], 2)
    lighter = replace(doubtful, curves=(replace(CURVES[0], weight=2 / 3), CURVES[1]), settings=())
    assert len(of_comparisons(["old", "new"], [lighter]).lines) == 1
    results = {"z": SAME, "x": doubtful, "y": CHANGED}
    whole = of_campaigns(["old@1", "new"], results, only_in={"w": "new"})
    assert whole.lines[0] == "3 runs: 2 changed, 1 same."
    alone = "w: is only in new, and was not compared."
    assert whole.lines[1:] == (f"x: {shown.lines[1]}", alone)
    assert whole.document["only_in"] == {"w": "new"}
    assert (whole.document["before"], whole.document["after"]) == ("old@1", "new")
    assert whole.tables[0].title == "Every model against old@1"
    ratios = {run["run"]: run["ratio"] for run in whole.document["runs"]}
    assert ratios == {"x": 1.056, "y": 1.056, "z": 1.0}


ISSUE = Issue("warning", "spikes", "s.yaml:1:2", "there are spikes", "take them out", "data")


def test_issues_of_a_study_and_of_a_campaign():
    lines = ("warning: s.yaml:1:2: there are spikes [spikes]", "  take them out")
    for issues, questions, shown in (
        ((ISSUE,), ("is it kPa?",), (*lines, "not confirmed: is it kPa?")),
        ((), ("is it kPa?",), ("not confirmed: is it kPa?",)),
        ((), (), ("No issues.",)),
    ):
        view = of_inspection(Inspection(None, issues, (None, Path())), questions)
        assert (view.lines, view.document["issues"]) == (shown, issues)
    some, none = (Inspection(None, issues, (None, Path())) for issues in ((ISSUE,), ()))
    campaign = of_campaign({"a": some, "b": none, "c": DataError("no data", "look")})
    error = f"error: {DataError('no data', 'look')}"
    assert campaign.lines == ("a:", *lines, "b: no issues", "c:", error)
    assert campaign.document["runs"]["a"] == {"issues": (ISSUE,)}


def test_documents_hold_no_numbers_that_json_lacks(capsys):
    document = {1: np.array([1.5, np.nan]), "issue": ISSUE, "none": (float("-inf"), np.int64(3))}
    print_document(document)
    printed = json.loads(capsys.readouterr().out)
    assert printed["1"] == [1.5, None]
    assert printed["none"] == [None, 3]
    assert printed["issue"]["place"] == "s.yaml:1:2"


def test_a_full_disk_is_named_and_a_closed_pipe_is_not(capsys, monkeypatch):
    silenced = []
    monkeypatch.setattr(console, "_silence_stdout", lambda: silenced.append(True))
    assert settle(BrokenPipeError(errno.EPIPE, "x"), debug=False, as_json=False) == 141
    assert capsys.readouterr().err == ""
    assert settle(OSError(errno.ENOSPC, "x"), debug=False, as_json=False) == WriteError.exit_code
    assert "no space left" in capsys.readouterr().err
    assert len(silenced) == 2
    assert settle(OSError(errno.EIO, "x"), debug=False, as_json=False) == 1


def test_a_run_stands_for_its_spec_and_its_settings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runs = tmp_path / "runs"
    (runs / "a").mkdir(parents=True)
    (tmp_path / "a").mkdir()  # is the folder of its study
    (tmp_path / "b").mkdir()
    (tmp_path / "s.yaml").touch()
    assert console.folder_of(Path("a"), runs) == runs / "a"
    assert console.folder_of(Path("b"), runs) == Path("b")
    assert console.folder_of(Path("c"), runs) == runs / "c"
    origins = {runs / "a": Origin("../../s.yaml", "", ("x=1",)), Path("b"): Origin("")}
    monkeypatch.setattr(run_record, "load_origin", origins.get)
    assert spec_of(Path("a"), ["y=2"], runs) == (Path("s.yaml"), ["x=1", "y=2"])
    for other in ("b", "c", "s.yaml"):
        assert spec_of(Path(other), ["y=2"], runs) == (Path(other), ["y=2"])


def test_files_of_unknown_formats_are_refused():
    console.refuse_endings([Path("a.svg"), Path("b.tex")])
    with pytest.raises(UsageError, match=r"b\.doc"):
        console.refuse_endings([Path("a.svg"), Path("b.doc")])


def test_coefficients_of_a_model_with_memory_say_what_they_multiply():
    states = SimpleNamespace(
        resonances={}, ranges={}, step=0.1, ordered=False, scaled=True, names=("s",), margin=0.2,
        low=np.array([-1.0]), high=np.array([3.0]),
    )  # fmt: skip
    memory = SimpleNamespace(
        theta=np.array([2.0]), theta_error=np.array([0.1]), constant=1.5, terms=("p",),
        states=states, output="motion", errors_note="A note.",
    )  # fmt: skip
    coefficients, of_states = _memory_tables(memory)
    assert coefficients.rows == (("(constant)", 1.5, None), ("p", 2.0, 0.1))
    assert coefficients.notes == ("Coefficients of scaled states. A note.",)
    assert of_states.rows[0][0] == "s"
    states.scaled, memory.constant = False, 0.0
    (coefficients,) = _memory_tables(memory)
    assert coefficients.rows == (("p", 2.0, 0.1),)
    assert coefficients.notes == ("Coefficients in physical units. A note.",)


def test_samples_at_rest_neither_train_nor_validate():
    made = dataset_of({"x": np.arange(6.0)}, output="x", held_out=np.arange(6) > 3)
    curve = replace(made.curves[0], at_rest=np.arange(6) < 3)
    (shown,) = of_dataset(replace(made, curves=(curve,))).document["curves"]
    assert (shown["train"], shown["validate"]) == (1, 2)


def test_the_files_of_a_report_are_listed_in_the_order_of_the_alphabet(tmp_path):
    paths = [tmp_path / "report" / name for name in ("c.csv", "d/x", "a.svg", "b.html", "e.pdf")]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    listed = tuple(sorted(map(str, paths)))
    shown = of_stage("report", tmp_path)
    assert shown.document["files"] == shown.lines == listed
    (tmp_path / "report" / "index.html").touch()
    assert of_stage("report", tmp_path).lines == (f"page: {tmp_path / 'report' / 'index.html'}",)


def test_records_are_shown_by_their_stages(tmp_path, mapmore):
    record = {"stages": {"ingest": {"seconds": 0.254, "why": "forced"}, "fit": {}}}
    (tmp_path / "run.json").write_text(json.dumps(record))
    shown = [line.split() for line in mapmore("show", "run.json", code=0).stdout.splitlines()]
    assert ["ingest", "0.25", "forced"] in shown
    assert any(words[:1] == ["fit"] for words in shown)
    (tmp_path / "run.json").write_text('{"stages": 3}')
    mapmore("show", "run.json", code=4, says="is neither a scores.json nor a run.json")
