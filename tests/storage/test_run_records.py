"""The record of a run: what it lists, whose it is, and what becomes of one that is damaged."""

import json

import pytest

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.inputs import files_read
from mapmore_cli.storage.run_record import (
    RUN_RECORD,
    Origin,
    StageRecord,
    Stamp,
    holds_results,
    load_origin,
    load_records,
    recorded_name,
    refuse_newer,
    save_records,
    written_files,
)

STAMP, ORIGIN = Stamp(1, 2, "a"), Origin("../../top/a.yaml")


def saved(folder, outputs=("fit.h5",), files=()):
    for name in (*outputs, *files):
        (folder / name).write_text(name)
    stage = StageRecord(
        *("print", 3, "", {"order": 2}, {"in/a.csv": STAMP}, dict.fromkeys(outputs, STAMP)),
        *({"numpy": "2"}, 1.5, "forced"),
    )
    save_records(folder, "demo", ORIGIN, {"fit": stage}, dict.fromkeys(files, STAMP))
    return stage


def test_a_record_is_read_as_it_was_written(tmp_path):
    stage = saved(tmp_path)
    with files_read() as read:
        assert load_records(tmp_path) == {"fit": stage}
    assert {path.resolve().relative_to(tmp_path.parents[1]).as_posix() for path in read} == {
        "top/a.yaml",
        "top/in/a.csv",
    }
    assert (load_origin(tmp_path), recorded_name(tmp_path)) == (ORIGIN, "demo")
    assert load_records(tmp_path / "none", pytest.fail) == {}


def test_files_of_earlier_records_are_listed_as_long_as_they_exist(tmp_path):
    saved(tmp_path, files=("search.json", "gone.json", "model.h5"))
    (tmp_path / "gone.json").unlink()
    saved(tmp_path, outputs=("fit.h5", "model.h5"), files=("b.yaml",))
    listed = json.loads((tmp_path / RUN_RECORD).read_text())["files"]
    assert [*listed] == ["b.yaml", "search.json"]
    assert {*written_files(tmp_path)} == {"b.yaml", "search.json", "fit.h5", "model.h5"}


@pytest.mark.parametrize(
    "damage",
    [{"stages": 3}, {"stages": {"fit": {}}}, {"format_version": "4.0"}, {"format_version": "x"}],
)
def test_a_damaged_record_lists_nothing(tmp_path, damage):
    saved(tmp_path)
    record = tmp_path / RUN_RECORD
    record.write_text(json.dumps({**json.loads(record.read_text()), **damage}))
    assert written_files(tmp_path) == {}
    told = []
    if "stages" in damage:
        assert load_records(tmp_path, told.append) == {}
        assert "every stage runs again" in told[0]
    else:
        with pytest.raises(DataError, match="format"):
            load_records(tmp_path, told.append)


@pytest.mark.parametrize(
    ("name", "known"), [("x" * 255, True), ("ü" * 128, False), ("x" * 256, False), ("a\0", False)]
)
def test_a_path_in_a_record_is_one_that_a_file_can_have(tmp_path, name, known):
    save_records(tmp_path, f"a/{name}", Origin(f"a/{name}"), {})
    assert (load_origin(tmp_path) is not None) is known
    assert recorded_name(tmp_path) == (f"a/{name}" if known else None)


@pytest.mark.parametrize(
    ("text", "ours"),
    [
        *(('{"creator": "mapmore"}', True), ('{"stages": {}}', True), ("{}", True), ("{", True)),
        *(('{"creator": "other"}', False), ('{"a": 1}', False), ("[1]", True)),
    ],
)
@pytest.mark.parametrize("record", [RUN_RECORD, "campaign.json"])
def test_a_folder_with_a_record_that_may_be_ours_holds_results(tmp_path, record, text, ours):
    assert not holds_results(tmp_path)
    (tmp_path / record).write_text(text)
    assert holds_results(tmp_path) is ours


def test_the_name_in_the_record_of_another_program_is_none_of_a_run(tmp_path):
    (tmp_path / RUN_RECORD).write_text('{"creator": "other", "name": "demo"}')
    assert recorded_name(tmp_path) is None


OWN = Origin("a.yaml", "c.yaml", ("x=1",))


@pytest.mark.parametrize(
    ("other", "rival"),
    [
        *((OWN, None), (Origin("b.yaml"), "b.yaml"), (Origin("gone.yaml"), None)),
        (Origin("a.yaml", "d.yaml", ("x=2",)), "d.yaml"),
        # the same campaign, the same settings, no campaign, and a campaign that is gone
        *(
            (Origin("a.yaml", "c.yaml", ("x=2",)), None),
            (Origin("a.yaml", "d.yaml", ("x=1",)), None),
        ),
        *((Origin("a.yaml", "", ("x=2",)), None), (Origin("a.yaml", "e.yaml", ()), None)),
    ],
)
def test_a_rival_makes_a_run_of_the_same_name(tmp_path, other, rival):
    for name in ("a.yaml", "b.yaml", "c.yaml", "d.yaml"):
        (tmp_path / name).write_text("")
    assert OWN.rival_of(other, tmp_path) == rival


def test_a_stamp_is_of_a_file_whose_known_numbers_are_the_same():
    stamp = Stamp(5, 7, "a", inode=3, ctime_ns=9)
    for place in range(4):
        state = [5, 7, 3, 9]
        assert stamp.is_of(state)
        state[place] += 1
        assert not stamp.is_of(state)
    assert Stamp(5, 7, "a").is_of([5, 7, 4, 4])
    assert not Stamp(0, 7, "a").is_of([5, 7, 4, 4])


def test_only_a_newer_major_version_is_refused(tmp_path):
    for found in ("1.2", "1.9", "0.1", "1"):
        refuse_newer(tmp_path, found, "1.2")
    with pytest.raises(DataError, match="by a newer mapmore"):
        refuse_newer(tmp_path, "2.0", "1.2")
