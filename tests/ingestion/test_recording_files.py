import os
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reading import refused

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.ingestion.files import find_sources, unique_ids
from mapmore_cli.ingestion.globs import expand, is_file_named
from mapmore_cli.storage.tables import RawTable
from mapmore_cli.study.sections.logs import FileEntry


@pytest.fixture
def tree(tmp_path):
    for name in (
        "b/run_2.csv",
        "b/run_10.csv",
        "a/run_2.csv.gz",
        "a/other.txt",
        "spec/x [1].csv",
        "spec/here.csv",
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1\n")
    return tmp_path / "spec"


def test_globs_are_sorted_and_named_from_the_folder_of_the_spec(tree):
    sources = find_sources(["../*/run_*.csv*", "here.csv"], tree)
    assert [source.name for source in sources] == [
        "../a/run_2.csv.gz",
        "../b/run_10.csv",
        "../b/run_2.csv",
        "here.csv",
    ]
    assert [source.id for source in sources] == ["a-run_2", "run_10", "b-run_2", "here"]
    assert all(source.path.is_file() for source in sources)


def test_absolute_patterns_give_the_same_names(tree):
    relative, absolute = (
        find_sources(["../b/*.csv"], tree),
        find_sources([f"{tree.parent}/b/*.csv"], tree),
    )
    assert [source.name for source in relative] == [source.name for source in absolute]


def test_name_with_brackets_is_taken_literally(tree):
    assert [source.id for source in find_sources(["x [1].csv"], tree)] == ["x [1]"]


def test_hidden_files_and_folders_are_meant_only_by_a_dot(tree):
    for name in (".hid.csv", ".in/hid.csv"):
        (tree / name).parent.mkdir(exist_ok=True)
        (tree / name).write_text("1\n")
    for pattern, found in (
        ("*hid.csv", []),
        ("*/hid.csv", []),
        ("**/*hid.csv", []),
        (".h*.csv", [".hid.csv"]),
        (".i*/*.csv", [".in/hid.csv"]),
        (".in/**/hid.csv", [".in/hid.csv"]),
    ):
        with refused("no such file") if not found else nullcontext():
            assert [source.name for source in find_sources([pattern], tree)] == found


def test_the_progress_counts_the_bytes_of_files_and_not_of_tables_in_memory(tree):
    table = RawTable({"P": np.ones(3)}, range(3), "memory")
    sources = find_sources(["here.csv", "memory"], tree, tables={"memory": table})
    assert [source.bytes for source in sources] == [2, 0]


def test_entries_carry_constants_and_an_id(tree):
    (source,) = find_sources([FileEntry(path="here.csv", set={"strain": 0.04}, id="first")], tree)
    assert (source.id, source.constants) == ("first", {"strain": 0.04})


@pytest.mark.parametrize(
    ("entries", "error", "parts"),
    [
        (["run_*.csv"], DataError, ["run_*.csv: no such file", "here.csv"]),
        (["../b/run_3.csv"], DataError, ["../b/run_3.csv", "run_2.csv"]),
        (["../c/run_2.csv"], DataError, ["folder", "does not exist"]),
        (["../b"], DataError, ["../b: is a folder", "../b/*.csv"]),
        (
            ["../b/*.csv", "../*/run_10.csv"],
            DataError,
            ["../b/run_10.csv: is named twice", "../b/*.csv", "../*/run_10.csv"],
        ),
        (["here.csv", "../spec/here.csv"], DataError, ["here.csv: is named twice"]),
        ([FileEntry(path="../b/*.csv", id="b")], SpecError, ["id 'b' is given to 2 files"]),
        (
            [FileEntry(path="here.csv", id="run_10"), "../b/run_10.csv"],
            SpecError,
            ["2 recordings have the id 'run_10'"],
        ),
    ],
)
def test_files_that_cannot_be_meant(tree, entries, error, parts):
    with refused(*parts, error=error):
        find_sources(entries, tree)


@given(
    st.lists(
        st.lists(st.sampled_from(["a", "b", "c"]), min_size=1, max_size=3).map("/".join),
        min_size=1,
        max_size=8,
        unique=True,
    )
)
def test_ids_are_as_short_as_unique_names_allow(paths):
    ids = unique_ids([f"{path}.csv" for path in paths])
    assert len(ids) == len(paths)
    assert all(path.replace("/", "-").endswith(name) for path, name in zip(paths, ids, strict=True))
    assert all(
        name == path.replace("/", "-")
        for path, name in zip(paths, ids, strict=True)
        if ids.count(name) > 1
    )


def test_globs_that_lead_through_a_whole_computer(tree, monkeypatch):
    deep = "../*/*.csv"
    monkeypatch.setattr("mapmore_cli.ingestion.globs.MOST_FOLDERS", 3)
    assert len(find_sources([deep], tree)) == 4
    monkeypatch.setattr("mapmore_cli.ingestion.globs.MOST_FOLDERS", 2)
    for pattern in (deep, "../**/*.csv"):
        with refused(f"{pattern}: matches paths through more than 2 folders", "`measured/*/*.csv`"):
            find_sources([pattern], tree)


RECORD = '{"creator": "mapmore", "stages": {}}'


def test_a_glob_enters_no_folder_with_results(tree):
    """Otherwise, the second run would read what the first one has written."""
    patterns = ["../**/*.csv", "../*/*.csv"]
    before = [find_sources([pattern], tree) for pattern in patterns]
    for name, record in {"out/a": "run.json", "campaign": "campaign.json"}.items():
        place = tree.parent / name / "report"
        place.mkdir(parents=True)
        for folder in (place, place.parent):
            (folder / "scores.csv").write_text("x\n1\n")
        (place.parent / record).write_text(RECORD)
    warnings = []
    again = [find_sources([pattern], tree, warn=warnings.append) for pattern in patterns]
    assert again == before
    assert len(warnings) == 2
    assert warnings[0] == (
        "../**/*.csv: no recordings are read in ../campaign, ../out/a, because results of mapmore "
        "lie there"
    )
    joins = [SimpleNamespace(files=patterns[1:])]
    find_sources(patterns[1:], tree, joins, warn=warnings.append)
    assert warnings[2:] == [warnings[1]] * 2
    with refused("../out/*/*.csv: no such file outside of the results of mapmore in ../out/a"):
        find_sources(["../out/*/*.csv"], tree)
    assert [one.id for one in find_sources(["../out/a/*.csv"], tree)] == ["scores"]
    (tree.parent / "campaign/campaign.json").write_text('{"creator": "another program"}')
    assert len(find_sources(["../*/*.csv"], tree)) == len(before[1]) + 1


@pytest.mark.parametrize(("count", "more"), [(4, ""), (5, ", ...")])
def test_at_most_four_folders_with_results_are_named_in_alphabetical_order(tree, count, more):
    for letter in "edcba"[-count:]:
        (tree / letter).mkdir()
        (tree / letter / "run.json").write_text(RECORD)
    warnings = []
    find_sources(["**/*.csv"], tree, warn=warnings.append)
    assert f" in a, b, c, d{more}, because" in warnings[0]


def test_bad_files_are_left_out_only_if_the_spec_names_them(tree):
    for bad, left in ((True, 2), (False, 2), (["here.csv"], 1), (["*.csv"], 0)):
        assert len(find_sources(["*.csv"], tree, bad=bad)) == left
    (tree / "empty.csv").write_text("")
    assert len(find_sources(["*.csv"], tree, bad=["empty.csv"])) == 2
    with refused("empty.csv: is empty"):
        find_sources(["*.csv"], tree)


def test_what_is_no_file_of_a_recording_is_named(tree):
    (tree / "gone.csv").symlink_to("nowhere.csv")
    os.mkfifo(tree / "pipe.csv")
    (tree / "empty.csv").write_text("")
    for name in ("a`b.csv", "a\nb.csv"):
        (tree / name).write_text("1\n")
    for name, told in (
        ("gone.csv", "is a link to a file that does not exist"),
        ("pipe.csv", "is not a regular file"),
        ("empty.csv", "is empty"),
        ("a`b.csv", "must be one line of valid text"),
        ("a\nb.csv", "must be one line of valid text"),
    ):
        for pattern in (name, f"{name[:-5]}?.csv"):
            with refused(told):
                expand(pattern, tree)
    assert [path.name for path in expand("empty.csv", tree, may_be_empty=True)] == ["empty.csv"]
    (tree / "none").mkdir()
    with refused("none/a.csv: no such file", "none is empty"):
        expand("none/a.csv", tree)
    for number in range(5):
        (tree / "none" / f"{number}.txt").write_text("")
    with refused("contains: 0.txt, 1.txt, 2.txt, 3.txt, ..."):
        expand("none/a.csv", tree)
    (tree / "none" / "4.txt").unlink()
    with refused("contains: 0.txt, 1.txt, 2.txt, 3.txt") as told:
        expand("none/a.csv", tree)
    assert told.value.remedy.endswith("3.txt")


def test_a_folder_that_links_lead_back_to_is_entered_once(tree):
    (tree / "back").symlink_to("..")
    (tree / "sub").mkdir()
    found = [path.relative_to(tree).as_posix() for path in expand("**/*.csv", tree)]
    assert found == ["back/b/run_10.csv", "back/b/run_2.csv", "here.csv", "x [1].csv"]


@pytest.mark.parametrize(
    ("name", "pattern", "named"),
    [
        *(("in/a.csv", "a.csv", True), ("in/a.csv", "*.csv", True), ("in/a.csv", "in/*", True)),
        *(("in/a.csv", "./in/a.csv", True), ("in/a[1].csv", "a[1].csv", True)),
        *(
            ("in/a.csv", "b.csv", False),
            ("in/a.csv", "out/*.csv", False),
            ("in/a", "in", False),
        ),
    ],
)
def test_a_pattern_without_folders_names_files_in_all_folders(tree, name, pattern, named):
    assert is_file_named(name, pattern, tree) is named
