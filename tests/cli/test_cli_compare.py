"""`mapmore freeze` and `mapmore compare`: this campaign of a muscle against an earlier one."""

import json
import shutil
import stat
from pathlib import Path
from types import SimpleNamespace

import pytest
from cli_samples import CHANGED, change_forces, write_study

from mapmore_cli.cli.compare import _of_campaigns, _of_models, compare
from mapmore_cli.cli.console import View
from mapmore_cli.domain.errors import LimitMissed, UsageError


def scaled_study(folder, factor):
    """The study with all forces multiplied."""
    folder.mkdir()
    spec = write_study(folder, held_out=())
    for path in folder.glob("bench_*.csv"):
        change_forces(path, lambda force: factor * force)
    return spec


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory, mapmore):
    """Runs of the study as it was, and with 2 % and 6 % more force; the first is frozen."""
    folder = tmp_path_factory.mktemp("campaigns")
    for name, factor in (("first", 1.0), ("second", 1.02), ("third", 1.06)):
        spec = scaled_study(folder / name, factor)
        mapmore("run", spec, "--runs", folder / "runs", "-q", "--set", f"name={name}", code=0)
    mapmore(
        "freeze",
        "first",
        "--tag",
        "2025",
        "--runs",
        folder / "runs",
        "--archive",
        folder / "archive",
        code=0,
    )
    return folder


def compared(mapmore, folder, *arguments, **expected):
    return mapmore(
        "compare",
        *arguments,
        "--runs",
        folder / "runs",
        "--archive",
        folder / "archive",
        **expected,
    )


def test_a_frozen_model_is_kept_with_all_that_it_came_from(campaigns, mapmore):
    folder = campaigns / "archive" / "first@2025"
    assert {path.name for path in folder.iterdir()} == {
        "model.h5", "scores.json", "scores.csv", "experiment.yaml", "run.json", "frozen.json",
    }  # fmt: skip
    for path in folder.iterdir():
        assert stat.S_IMODE(path.stat().st_mode) == 0o444
    assert (folder / "model.h5").read_bytes() == (
        campaigns / "runs" / "first" / "model.h5"
    ).read_bytes()
    same_tag = ("--tag", "2025", "--runs", campaigns / "runs", "--archive", campaigns / "archive")
    mapmore("freeze", "second", *same_tag, code=0)  # another run
    mapmore("freeze", "first", *same_tag, code=7, says="is frozen already")
    shutil.rmtree(campaigns / "archive" / "second@2025")


def test_the_change_is_found_and_told(campaigns, mapmore):
    assert (
        "third has changed: force is 1.06"
        in compared(mapmore, campaigns, "2025", "third", code=0).stdout
    )
    document = json.loads(compared(mapmore, campaigns, "first@2025", "third", "--json").stdout)
    assert document["changed"] is True
    assert document["ratio"] == pytest.approx(1.06, abs=0.003)
    assert document["interval"][0] > 1.05
    assert len(document["curves"]) == 3
    assert document["p_permutation"] is None
    same = json.loads(
        compared(
            mapmore, campaigns, "first", campaigns / "runs" / "first" / "model.h5", "--json"
        ).stdout
    )
    assert (same["answer"], same["ratio"], same["p"]) == ("settings", 1.0, 1.0)


@pytest.mark.parametrize(
    ("fail_on", "later", "code"),
    [("changed", "third", 6), ("0.03", "second", 0), ("0.03", "third", 6), ("1", "third", 0)],
)
def test_a_change_can_fail_a_pipeline(campaigns, mapmore, fail_on, later, code):
    result = compared(mapmore, campaigns, "2025", later, "--fail-on", fail_on, "--json", code=code)
    assert json.loads(result.stdout)["after"] == later


def test_drift_over_campaigns(campaigns, mapmore, tmp_path):
    result = compared(
        mapmore,
        campaigns,
        "2025",
        "second",
        "third",
        "--figure",
        tmp_path / "drift.svg",
        "--json",
        code=0,
    )
    ratios = [one["ratio"] for one in json.loads(result.stdout)["campaigns"]]
    assert ratios == pytest.approx([1.02, 1.06], abs=0.003)
    assert "third has changed" in compared(mapmore, campaigns, "2025", "second", "third").stdout
    text = (tmp_path / "drift.svg").read_text()
    assert all(word in text for word in ("2025", "second", "third", "pressure 100"))


def test_a_difference_of_settings_is_not_the_muscle_s(campaigns, mapmore):
    """A model of the same recordings by another spec is refused, or told to be that."""
    spec, runs = campaigns / "first" / "bench.yaml", ("--runs", campaigns / "runs")
    changed = ("--set", "name=fused", "--set", "fuse.z_s=0.1", "--set", "report.figures=[fit]")
    mapmore("fuse", spec, *runs, "-q", *changed, code=0)
    refused = compared(mapmore, campaigns, "2025", "fused", code=2, says="--allow-other-settings")
    assert "fuse.z_s: 0.25 -> 0.1" in refused.stderr
    allowed = ("2025", "fused", "--allow-other-settings")
    told = compared(mapmore, campaigns, *allowed, "--fail-on", "changed", code=0).stdout
    assert (
        "same recordings as 2025: a difference comes from the settings, not from the muscle" in told
    )
    assert "The settings differ: fuse.z_s: 0.25 -> 0.1." in told
    document = json.loads(compared(mapmore, campaigns, *allowed, "--json").stdout)
    assert (document["answer"], document["same_recordings"]) == ("settings", True)
    mapmore("run", spec, *runs, "-q", *changed, code=0)
    frozen = ("--tag", "x", *runs, "--archive", campaigns / "x")
    said = mapmore("freeze", "fused", *frozen, code=0)
    assert said.stdout == f"{campaigns / 'x' / 'fused@x'}\n"
    assert "fused@x: made from bench.yaml" in said.stderr
    assert "the spec alone makes a different model" in said.stderr
    assert "made with --set fuse.z_s=0.1; write these settings into the spec" in said.stderr


def test_a_key_that_a_later_version_has_is_no_other_setting(campaigns, mapmore, tmp_path):
    """Found by thought: every model frozen by an older version would be refused."""
    older = tmp_path / "older"
    shutil.copytree(campaigns / "runs" / "first", older)
    record = json.loads((older / "run.json").read_text())
    made_by = record["stages"]["fuse"]["slice"]
    del made_by["fuse"]["hold"], made_by["fit"]["margin"], made_by["dictionary"][0]["spline"]
    (older / "run.json").write_text(json.dumps(record))
    compared(mapmore, campaigns, older, "third", code=0, says="")
    made_by["dictionary"][0]["polynomial"]["order"] += 1
    (older / "run.json").write_text(json.dumps(record))
    refused = compared(mapmore, campaigns, older, "third", code=2)
    assert "dictionary" in refused.stderr


def test_a_campaign_is_frozen_and_compared_run_by_run(campaigns, mapmore, tmp_path):
    runs = tmp_path / "runs"
    for name in ("first", "second"):
        shutil.copytree(campaigns / "runs" / name, runs / name)
    (runs / "both").mkdir()
    members = {"campaign": "both", "runs": ["first", "second"]}
    (runs / "both" / "campaign.json").write_text(json.dumps(members))
    places = ("--runs", runs, "--archive", tmp_path / "archive")
    frozen = mapmore("freeze", "both", "--tag", "x", *places, code=0).stdout.split()
    assert frozen == [str(tmp_path / "archive" / name) for name in ("first@x", "second@x")]
    mapmore("freeze", "both", "--tag", "x", *places, code=7, says="frozen already")
    shutil.rmtree(runs / "second")
    shutil.copytree(campaigns / "runs" / "third", runs / "second")  # measured anew
    arguments = ("compare", "both@x", "both", *places)
    result = mapmore(*arguments, "--json", "--fail-on", "0.03", code=6)
    answers = {one["run"]: one["answer"] for one in json.loads(result.stdout)["runs"]}
    assert answers == {"first": "settings", "second": "changed"}
    assert "2 runs: 1 changed, 1 settings." in mapmore(*arguments, code=0).stdout
    mapmore("compare", "both@x", "first", *places, code=2, says="one other campaign")
    drift = ("--figure", tmp_path / "drift.svg")
    mapmore(*arguments, *drift, code=2, says="drift of campaigns cannot be drawn")
    members["runs"] = ["first"]  # as if the other run failed
    (runs / "both" / "campaign.json").write_text(json.dumps(members))
    only = "second: is only in both@x, and was not compared."
    assert only in mapmore(*arguments, code=0).stdout
    mapmore(*arguments, "--fail-on", "0.5", code=6, says="allows no run that is not compared")
    (runs / "both" / "campaign.json").write_text(json.dumps({**members, "runs": []}))
    mapmore(*arguments, code=2, says="have no run in common")
    members["runs"].append("../elsewhere")
    (runs / "both" / "campaign.json").write_text(json.dumps(members))
    mapmore(
        "freeze",
        "both",
        "--tag",
        "y",
        *places,
        code=4,
        says="does not contain the names of the campaign's runs",
    )


def test_runs_of_only_one_campaign_are_named_in_the_order_of_the_alphabet(monkeypatch):
    monkeypatch.setattr("mapmore_cli.pipeline.archive.compared", lambda *_: CHANGED)
    before, after = dict.fromkeys("hcagm", Path()), dict.fromkeys("dbmfe", Path())
    results, only_in = _of_campaigns(["x@1", "x"], [before, after], 0.02, other_settings=False)
    assert [*results] == ["m"]
    assert "".join(only_in) == "abcdefgh"
    assert [name for name, of in only_in.items() if of == "x@1"] == [*"acgh"]


@pytest.mark.parametrize(
    ("fail_on", "advice"), [("0.03", "a larger number"), ("changed", "--fail-on 0.03")]
)
def test_the_error_names_the_output(monkeypatch, fail_on, advice):
    monkeypatch.setattr("mapmore_cli.pipeline.archive.find_campaign", lambda *_: None)
    monkeypatch.setattr("mapmore_cli.pipeline.archive.find_model", lambda *_: Path("a"))
    results = {"new": CHANGED}, View({})
    monkeypatch.setattr("mapmore_cli.cli.compare._of_models", lambda *_: results)
    with pytest.raises(LimitMissed, match="new: the predicted torque is 1") as caught:
        compare(["old", "new"], fail_on=fail_on)
    assert advice in caught.value.remedy


def test_outputs_are_compared_one_by_one_and_models_with_the_first(monkeypatch):
    asked, outputs = [], {"a": "x"}

    def compared(*of):
        asked.append(of)
        return CHANGED

    def model_at(path):
        of = [SimpleNamespace(name=name) for name in outputs[path.name]]
        return SimpleNamespace(outputs=of)

    monkeypatch.setattr("mapmore_cli.pipeline.archive.compared", compared)
    monkeypatch.setattr("mapmore_cli.storage.artefacts.read_model", model_at)
    one, other, third = paths = [Path(name) for name in "abc"]
    results, view = _of_models(["old", "mid", "new"], paths, 0.02, other_settings=True)
    assert asked == [(one, other, 0.02, True), (one, third, 0.02, True)]
    assert ([*results], view.document["after"]) == (["new"], "new")
    outputs["a"] = "xy"
    with pytest.raises(UsageError, match="several outputs are compared two at a time"):
        _of_models(["old", "mid", "new"], paths, 0.02, other_settings=False)
    results, view = _of_models(["old", "new"], paths[:2], 0.02, other_settings=False)
    assert asked[2:] == [(one, other, 0.02, False, name) for name in "xy"]
    assert [*results] == [each["run"] for each in view.document["runs"]] == ["x", "y"]
    assert view.lines[0].startswith("2 outputs: 2 changed.")
