"""`mapmore freeze` and `mapmore compare`: this campaign of a muscle against an earlier one."""

from __future__ import annotations

import json
import shutil
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli_samples import write_study

Call = Callable[..., Any]


def scaled_study(folder: Path, factor: float) -> Path:
    """The study with all forces multiplied."""
    folder.mkdir()
    spec = write_study(folder)
    for path in folder.glob("bench_*.csv"):
        head, *lines = path.read_text().splitlines()
        rows = [line.split(",") for line in lines]
        path.write_text("\n".join([head, *(f"{p},{e},{factor * float(f):.6f}" for p, e, f in rows)]) + "\n")
    spec.write_text(spec.read_text().replace("  split: {validate: {pressure: [200]}}\n", ""))
    return spec


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory: pytest.TempPathFactory, mapmore: Call) -> Path:
    """Runs of the study as it was, and with 2 % and 6 % more force; the first is frozen."""
    folder = tmp_path_factory.mktemp("campaigns")
    for name, factor in (("first", 1.0), ("second", 1.02), ("third", 1.06)):
        spec = scaled_study(folder / name, factor)
        result = mapmore("run", spec, "--runs", folder / "runs", "-q", "--set", f"name={name}")
        assert result.exit_code == 0, result.stderr
    result = mapmore("freeze", "first", "--tag", "2025", "--runs", folder / "runs", "--archive", folder / "archive")
    assert result.exit_code == 0, result.stderr
    return folder


def compared(mapmore: Call, folder: Path, *arguments: object) -> Any:
    return mapmore("compare", *arguments, "--runs", folder / "runs", "--archive", folder / "archive")


def test_a_frozen_model_is_kept_with_all_that_it_came_from(campaigns: Path, mapmore: Call) -> None:
    folder = campaigns / "archive" / "first@2025"
    assert {path.name for path in folder.iterdir()} == {
        "model.h5", "scores.json", "scores.csv", "experiment.yaml", "run.json", "frozen.json",
    }  # fmt: skip
    for path in folder.iterdir():
        assert stat.S_IMODE(path.stat().st_mode) == 0o444
    assert (folder / "model.h5").read_bytes() == (campaigns / "runs" / "first" / "model.h5").read_bytes()
    again = mapmore("freeze", "second", "--tag", "2025", "--runs", campaigns / "runs", "--archive", campaigns / "archive")
    assert again.exit_code == 0  # of another run
    taken = mapmore("freeze", "first", "--tag", "2025", "--runs", campaigns / "runs", "--archive", campaigns / "archive")
    assert taken.exit_code == 7
    assert "is frozen already" in taken.stderr
    (campaigns / "archive" / "second@2025" / "model.h5").chmod(0o644)
    for path in (campaigns / "archive" / "second@2025").iterdir():
        path.unlink()
    (campaigns / "archive" / "second@2025").rmdir()


def test_the_change_is_found_and_told(campaigns: Path, mapmore: Call) -> None:
    result = compared(mapmore, campaigns, "2025", "third")
    assert result.exit_code == 0, result.stderr
    assert "third has changed: force is 1.06" in result.stdout
    document = json.loads(compared(mapmore, campaigns, "first@2025", "third", "--json").stdout)
    assert document["changed"] is True
    assert document["ratio"] == pytest.approx(1.06, abs=0.003)
    assert document["interval"][0] > 1.05
    assert len(document["curves"]) == 3
    assert document["p_permutation"] is None
    same = json.loads(compared(mapmore, campaigns, "first", campaigns / "runs" / "first" / "model.h5", "--json").stdout)
    assert (same["changed"], same["ratio"]) == (False, 1.0)


@pytest.mark.parametrize(
    ("fail_on", "later", "code"), [("changed", "third", 6), ("0.03", "second", 0), ("0.03", "third", 6), ("1", "third", 0)]
)
def test_a_change_can_fail_a_pipeline(campaigns: Path, mapmore: Call, fail_on: str, later: str, code: int) -> None:
    result = compared(mapmore, campaigns, "2025", later, "--fail-on", fail_on, "--json")
    assert result.exit_code == code
    assert json.loads(result.stdout)["after"] == later


def test_drift_over_campaigns(campaigns: Path, mapmore: Call, tmp_path: Path) -> None:
    result = compared(mapmore, campaigns, "2025", "second", "third", "--figure", tmp_path / "drift.svg", "--json")
    assert result.exit_code == 0, result.stderr
    ratios = [one["ratio"] for one in json.loads(result.stdout)["campaigns"]]
    assert ratios == pytest.approx([1.02, 1.06], abs=0.003)
    text = (tmp_path / "drift.svg").read_text()
    assert all(word in text for word in ("2025", "second", "third", "pressure 100"))


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("2025",), 2, "needs two models"),
        (("2025", "fourth"), 4, "there is no model of this name"),
        (("2025", "third", "--fail-on", "drift"), 2, "neither `changed`"),
        (("2025", "third", "--figure", "x.docx"), 2, ".svg"),
    ],
)
def test_wrong_questions(campaigns: Path, mapmore: Call, arguments: tuple[str, ...], code: int, words: str) -> None:
    result = compared(mapmore, campaigns, *arguments)
    assert result.exit_code == code
    assert words in result.stderr


def test_a_run_that_is_not_in_order_is_not_frozen(campaigns: Path, mapmore: Call, tmp_path: Path) -> None:
    result = mapmore("freeze", tmp_path, "--tag", "x", "--archive", tmp_path / "archive")
    assert result.exit_code == 4
    result = mapmore("freeze", campaigns / "runs" / "third", "--tag", "../x", "--archive", tmp_path / "archive")
    assert result.exit_code == 2


@pytest.mark.parametrize("name", [None, "", 3, "..", "../elsewhere", "{tmp}/elsewhere", ".hidden", "a\nb"])
def test_a_run_whose_record_has_no_name_of_a_run_is_not_frozen(campaigns: Path, mapmore: Call, tmp_path: Path, name: object) -> None:
    """Found by fuzzing: without a name it was an internal fault, and a stranger's name led out of the archive."""
    run = tmp_path / "run"
    shutil.copytree(campaigns / "runs" / "third", run)
    record = json.loads((run / "run.json").read_text())
    del record["name"]
    if name is not None:
        record["name"] = name.replace("{tmp}", str(tmp_path)) if isinstance(name, str) else name
    (run / "run.json").write_text(json.dumps(record))
    result = mapmore("freeze", run, "--tag", "x", "--archive", tmp_path / "archive")
    assert result.exit_code == 4
    assert "has no name of a run" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"sha256": []}', "[" * 100_000])
def test_a_damaged_record_of_a_frozen_model_is_refused(campaigns: Path, mapmore: Call, tmp_path: Path, text: str) -> None:
    shutil.copytree(campaigns / "archive" / "first@2025", tmp_path / "first@2025")
    record = tmp_path / "first@2025" / "frozen.json"
    record.chmod(0o644)
    record.write_text(text)
    result = mapmore("compare", "first@2025", "third", "--runs", campaigns / "runs", "--archive", tmp_path)
    assert result.exit_code == 4
    assert "is not the model that was frozen" in result.stderr


def test_a_frozen_model_that_was_changed_is_refused(campaigns: Path, mapmore: Call, tmp_path: Path) -> None:
    assert mapmore("freeze", campaigns / "runs" / "third", "--tag", "new", "--archive", tmp_path).exit_code == 0
    model = tmp_path / "third@new" / "model.h5"
    model.chmod(0o644)
    model.write_bytes((campaigns / "runs" / "second" / "model.h5").read_bytes())
    result = mapmore("compare", "new", "third", "--runs", campaigns / "runs", "--archive", tmp_path)
    assert result.exit_code == 4
    assert "is not the model that was frozen" in result.stderr


def test_a_frozen_model_stands_among_the_competitors_and_stays_as_it_is(campaigns: Path, mapmore: Call) -> None:
    spec, frozen = campaigns / "third" / "bench.yaml", campaigns / "archive" / "first@2025" / "model.h5"
    before = frozen.read_bytes()
    against = "validate.against=[{model: ../archive/first@2025/model.h5, as: before}]"
    arguments = ("run", spec, "--runs", campaigns / "runs", "-q", "--json", "--set", "name=fourth", "--set", against)
    result = mapmore(*arguments)
    assert result.exit_code == 0, result.stderr
    rmse = {row["model"]: row["rmse"] for row in json.loads(result.stdout)["scores"] if row["curve"] == "all"}
    assert rmse["before"] > 5 * rmse["mapmore"]
    assert frozen.read_bytes() == before
    assert set(json.loads(mapmore(*arguments).stdout)["stages"].values()) == {"up-to-date"}
    wrong = mapmore(*arguments[:-1], against.replace("first@2025", "nobody@2025"))
    assert wrong.exit_code == 3
    assert "mapmore freeze" in wrong.stderr
    nameless = mapmore(*arguments[:-1], against.replace(", as: before", ""))
    assert nameless.exit_code == 3
