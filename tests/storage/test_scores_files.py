"""scores.csv and scores.json: digits, stable bytes, and numbers that are not finite; and run.json:
stages made from old results.
"""

import csv
import json
import math
from contextlib import nullcontext
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stored_records import records, same

from mapmore_cli.cli.views import of_file
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.foreign import csv_cell
from mapmore_cli.domain.scores import Score, ScoreTable
from mapmore_cli.storage import run_record
from mapmore_cli.storage.run_record import refuse_stale, stale_stages
from mapmore_cli.storage.scores import read_scores, write_scores

ROW = Score(
    "mapmore",
    "force",
    "validate",
    "pressure=250",
    40,
    12.3456789012345,
    0.02,
    617.0,
    "max|force|",
    30.0,
    0.05,
    1 / 3,
)
COLUMNS = [field.name for field in fields(Score)]


def written(folder, *rows):
    """The rows of scores.json, which scores.csv has as well."""
    write_scores(
        folder, ScoreTable(rows, {"force": "N"}, ("sarosi",), ("worse than the mean",)), "demo"
    )
    found = json.loads((folder / "scores.json").read_text(encoding="utf-8"))["scores"]
    with (folder / "scores.csv").open(newline="", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    plain = [
        {key: csv_cell(cell) if isinstance(cell, str) else cell for key, cell in row.items()}
        for row in found
    ]
    assert [
        {key: "" if cell is None else str(cell) for key, cell in row.items()} for row in plain
    ] == table
    return found


def test_document(tmp_path):
    (row,) = written(tmp_path, ROW)
    text = (tmp_path / "scores.json").read_text(encoding="utf-8")
    document = json.loads(text)
    assert list(document) == [
        *("name", "target", "units", "scores", "failed", "warnings", "alerts")
    ]
    assert (document["name"], document["target"], document["units"]) == (
        "demo",
        "force",
        {"force": "N"},
    )
    assert list(row) == COLUMNS
    assert row["rmse"] == 12.3456789012  # 12 significant digits
    assert row["r2"] == 0.333333333333
    assert row["n"] == 40
    assert text.endswith("}\n")
    assert len(written(tmp_path, ROW, replace(ROW, model='odd, "name"', curve="all"))) == 2


@pytest.mark.parametrize(
    ("number", "shown"),
    [(math.nan, None), (math.inf, None), (-math.inf, None), (-0.0, 0.0), (np.float64(2.5), 2.5)],
)
def test_numbers_as_they_are_written(number, shown, tmp_path):
    (row,) = written(tmp_path, replace(ROW, rmse=number))
    assert repr(row["rmse"]) == repr(shown)


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scores=st.lists(records(Score), max_size=3))
def test_digits_survive(scores, tmp_path):
    for score, row in zip(scores, written(tmp_path, *scores), strict=True):
        assert row["rmse"] == (
            pytest.approx(score.rmse, rel=1e-11, abs=0) if math.isfinite(score.rmse) else None
        )
    back = read_scores(tmp_path / "scores.json")
    assert (back.units, back.failed, back.warnings) == (
        {"force": "N"},
        ("sarosi",),
        ("worse than the mean",),
    )
    for score, read in zip(scores, back.scores, strict=True):
        assert read.rmse == pytest.approx(score.rmse, rel=1e-11, abs=0) or not math.isfinite(
            score.rmse
        )
        assert same(
            replace(
                read,
                **{
                    name: getattr(score, name)
                    for name in COLUMNS
                    if isinstance(getattr(score, name), float)
                },
            ),
            score,
        )


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"scores": [3]}', '{"scores": [{"model": "x"}], "units": {}}', "[" * 100_000],
)
def test_a_file_that_says_something_else_is_refused(text, tmp_path):
    (tmp_path / "scores.json").write_text(text)
    with pytest.raises(DataError, match="no table of scores") as refused:
        read_scores(tmp_path / "scores.json")
    assert "--force" in (refused.value.remedy or "")


@pytest.mark.parametrize("count", ["Infinity", "1e999", "[]", "{}"])
def test_a_count_that_is_none_is_wrong_data(count, tmp_path):
    written(tmp_path, ROW)
    path = tmp_path / "scores.json"
    path.write_text(
        path.read_text(encoding="utf-8").replace('"n": 40', f'"n": {count}'), encoding="utf-8"
    )
    with pytest.raises(DataError, match="no table of scores"):
        read_scores(path)
    with pytest.raises(DataError, match="neither"):
        of_file(path, print, False)


def test_scores_of_a_target_without_a_unit_are_shown(tmp_path):
    write_scores(tmp_path, ScoreTable((ROW, replace(ROW, curve="all")), {}), "demo")
    assert len(of_file(tmp_path / "scores.json", print, False).tables) == 1


@pytest.mark.parametrize(
    ("made_from", "old", "repeated"),
    [
        ("segment=ingest fit=segment fuse=fit", "", ""),
        ("fuse=other", "fuse", "ingest"),  # of the stages that there are
        ("validate=other", "validate", "ingest"),
        ("report=other", "report", "ingest"),  # a page is neither a model nor a score
        ("segment=other fit=segment fuse=fit", "segment fit fuse", "ingest"),
        ("segment=ingest fit=other report=fit", "fit report", "segment"),
        ("search=other segment=search fit=other", "search segment fit", "ingest"),
        ("search=ingest segment=ingest fit=segment", "", ""),  # of `tune`
    ],
)
def test_stages_behind_one_that_was_repeated_are_old(made_from, old, repeated):
    """Fingerprints are names here."""
    pairs = [entry.split("=") for entry in ("ingest= " + made_from).split()]
    records = {name: SimpleNamespace(fingerprint=name, before=before) for name, before in pairs}
    assert stale_stages(records) == dict.fromkeys(old.split(), repeated)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_record, "load_records", lambda _folder: records)
        is_refused = old not in ("", "report")
        with pytest.raises(DataError, match="repeated since") if is_refused else nullcontext():
            refuse_stale(Path("runs/a"))
