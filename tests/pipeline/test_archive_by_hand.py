"""What a word on the command line stands for, and of which settings a comparison speaks."""

import json
from types import SimpleNamespace

import pytest

from mapmore_cli.domain.errors import DataError, UsageError, WriteError
from mapmore_cli.pipeline import archive as module
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


def test_a_frozen_campaign_has_the_runs_with_which_it_was_frozen(places):
    """Its runs may have changed, or may have been removed, since."""
    model = places[1] / "b@x" / "model.h5"
    for campaign in ("both", "removed"):
        record = {"campaign": campaign, "sha256": {"model.h5": take_stamp(model).sha256}}
        model.with_name("frozen.json").write_text(json.dumps(record))
        assert find_campaign(f"{campaign}@x", *places) == {"b": model}


def test_settings_without_an_effect_on_the_model_are_not_named(tmp_path, monkeypatch):
    said = ["name=b", "report.width=3", "validate.require={}", "fit.max_terms=2"]
    for origin, made in (
        (None, ("", [])),
        (Origin("s.yaml", settings=said), ("s.yaml", ["fit.max_terms=2"])),
        (Origin("s.yaml", "c.yaml", said), ("c.yaml", [])),
    ):
        monkeypatch.setattr(module, "load_origin", lambda _, of=origin: of)
        assert made_from(tmp_path) == made


@pytest.fixture
def finished(tmp_path, monkeypatch):
    """A run as its stages wrote it, of which the spec and the record are no outputs."""
    run = tmp_path / "r"
    run.mkdir()
    for kept in KEPT:
        (run / kept).write_text(json.dumps({"name": "r"}))
    outputs = SimpleNamespace(outputs={kept: take_stamp(run / kept) for kept in KEPT[:3]})
    monkeypatch.setattr(module, "load_records", lambda _: {"all": outputs})
    return run


@pytest.mark.parametrize("name", KEPT)
def test_files_that_are_missing_or_not_as_the_run_wrote_them_are_not_frozen(finished, name):
    kept = finished.parent
    archive = kept / "new" / "archive"
    assert find_model("1", kept, freeze(finished, "1", archive).parent).is_file()
    (finished / name).write_text(json.dumps({"name": "r", "more": 1}))
    if name in KEPT[:3]:
        with pytest.raises(DataError, match=f"{name}: was changed after the run wrote it"):
            freeze(finished, "2", kept)
    else:
        freeze(finished, "2", kept)
    (finished / name).unlink()
    with pytest.raises(DataError, match=f"is not a finished run \\({name} missing\\)"):
        freeze(finished, "3", kept)


@pytest.mark.parametrize("name", [{}, {"name": 3}, {"name": "../elsewhere"}, {"name": "a\nb"}])
def test_a_run_whose_record_has_no_name_of_a_run_is_not_frozen(finished, name):
    """Found by fuzzing: without a name it was an internal fault, and a stranger's name led out of
    the archive.
    """
    (finished / "run.json").write_text(json.dumps(name))
    with pytest.raises(DataError, match="does not contain the name of the run"):
        freeze(finished, "x", finished.parent / "archive")
    assert [path.name for path in finished.parent.iterdir()] == ["r"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"sha256": []}', "[" * 100_000, "another model"])
def test_a_frozen_model_or_record_that_was_changed_is_refused(finished, text):
    frozen = freeze(finished, "1", finished.parent)
    changed = frozen / ("model.h5" if text == "another model" else "frozen.json")
    changed.chmod(0o644)
    changed.write_text(text)
    with pytest.raises(DataError, match="was changed after it was frozen"):
        find_model("1", finished, finished.parent)


def test_a_run_that_another_process_wrote_meanwhile_is_not_frozen_in_part(finished, monkeypatch):
    def read(path):
        (finished / "scores.json").write_text("newer")
        return path.read_bytes()

    monkeypatch.setattr(
        module, "write_own", lambda copy, _: copy.write_bytes(read(finished / copy.name))
    )
    with pytest.raises(DataError, match="was changed after the run wrote it"):
        freeze(finished, "now", finished.parent)
    assert not [*finished.parent.glob("*@*")]


def test_a_model_that_another_process_froze_meanwhile(finished, monkeypatch):
    """Found by torture: it was an internal fault."""
    place = finished.parent / "r@now"

    def meanwhile(_folder):
        place.mkdir()
        (place / "model.h5").write_text("theirs")

    monkeypatch.setattr(module, "sync_tree", meanwhile)
    with pytest.raises(WriteError, match="frozen already"):
        freeze(finished, "now", finished.parent)
    assert [one.name for one in finished.parent.glob("*@*")] == ["r@now"]
