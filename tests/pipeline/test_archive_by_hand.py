"""What a word on the command line stands for, and of which settings a comparison speaks."""

import json
from types import SimpleNamespace

import pytest

from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.pipeline.archive import KEPT, find_campaign, find_model, freeze, made_from
from mapmore_cli.storage.run_record import Origin
from mapmore_cli.storage.stamps import take_stamp


@pytest.fixture
def places(tmp_path):
    runs, archive = tmp_path / "runs", tmp_path / "archive"
    for folder in ("runs/a", "runs/y", "archive/a@x", "archive/b@x", "archive/b@y", "archive/b@z"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "model.h5").write_text(folder)
    (runs / "both").mkdir()
    (archive / ".c@z").mkdir()
    (archive / ".c@z" / "model.h5").touch()  # is unfinished
    (runs / "both" / "campaign.json").write_text(json.dumps({"runs": ["a", "b"]}))
    return runs, archive


@pytest.mark.parametrize(
    ("word", "folder"),
    [
        ("a", "runs/a"),
        ("y", "runs/y"),  # a run before a tag
        ("b@y", "archive/b@y"),
        ("a@x", "archive/a@x"),
        ("z", "archive/b@z"),
        ("{runs}/a", "runs/a"),
        ("{runs}/a/model.h5", "runs/a"),
    ],
)
def test_a_word_is_a_file_a_folder_a_run_or_a_tag(places, word, folder):
    assert find_model(word.format(runs=places[0]), *places).read_text() == folder


def test_words_of_no_model_or_of_several(places):
    with pytest.raises(UsageError, match=r"x: several frozen models have this tag: a@x, b@x"):
        find_model("x", *places)
    for word in ("b", "both", "c@z", "*", "a@y"):
        with pytest.raises(DataError, match="there is no model with this name"):
            find_model(word, *places)


def test_models_of_a_campaign_are_those_of_its_runs(places):
    runs, archive = places
    assert find_campaign("a", *places) is None
    assert find_campaign("both@x", *places) == {
        name: archive / f"{name}@x" / "model.h5" for name in "ab"
    }
    (runs / "b").mkdir()
    (runs / "b" / "model.h5").touch()
    assert find_campaign("both", *places) == {name: runs / name / "model.h5" for name in "ab"}


def test_settings_without_an_effect_on_the_model_are_not_named(tmp_path, monkeypatch):
    said = ["name=b", "report.width=3", "validate.require={}", "fit.max_terms=2"]
    for origin, made in (
        (None, ("", [])),
        (Origin("s.yaml", settings=said), ("s.yaml", ["fit.max_terms=2"])),
        (Origin("s.yaml", "c.yaml", said), ("c.yaml", [])),
    ):
        monkeypatch.setattr("mapmore_cli.pipeline.archive.load_origin", lambda _, of=origin: of)
        assert made_from(tmp_path) == made


@pytest.mark.parametrize("name", KEPT)
def test_files_that_are_missing_or_not_as_the_run_wrote_them_are_not_frozen(
    tmp_path, monkeypatch, name
):
    """The spec and the record are not outputs of a stage."""
    run, outputs = tmp_path / "r", KEPT[:3]
    run.mkdir()
    for kept in KEPT:
        (run / kept).write_text(json.dumps({"name": "r"}))
    stamps = {kept: take_stamp(run / kept) for kept in outputs}
    records = {"all": SimpleNamespace(outputs=stamps)}
    monkeypatch.setattr("mapmore_cli.pipeline.archive.load_records", lambda _: records)
    assert find_model("1", tmp_path, freeze(run, "1", tmp_path).parent).is_file()
    (run / name).write_text(json.dumps({"name": "r", "more": 1}))
    if name in outputs:
        with pytest.raises(DataError, match=f"{name}: was changed after the run wrote it"):
            freeze(run, "2", tmp_path)
    else:
        freeze(run, "2", tmp_path)
    (run / name).unlink()
    with pytest.raises(DataError, match=f"is not a finished run \\({name} missing\\)"):
        freeze(run, "3", tmp_path)
