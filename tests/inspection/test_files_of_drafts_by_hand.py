"""Which files a draft reads, which it leaves out, and on which of them it is tried, by hand."""

import os
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from reading import refused
from recorded import recording, write

from mapmore_cli.annexes.drafting import checked as checks
from mapmore_cli.annexes.drafting import cleaning, commands, second_log, studies
from mapmore_cli.annexes.drafting import reading as drafts
from mapmore_cli.annexes.drafting.answers import answers_of
from mapmore_cli.annexes.drafting.checked import checked, with_few_files
from mapmore_cli.annexes.drafting.commands import init
from mapmore_cli.annexes.drafting.draft import Draft, NamedColumn, Note
from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.annexes.drafting.names import NamedCondition
from mapmore_cli.annexes.drafting.outputs import as_files
from mapmore_cli.annexes.drafting.reading import table_of
from mapmore_cli.annexes.drafting.sources import patterns, started
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.annexes.drafting.studies import FolderStudy, find_studies
from mapmore_cli.cli.console import STANDARD
from mapmore_cli.domain.errors import DataError, SpecError, UsageError, WriteError
from mapmore_cli.ingestion.clock import REPEATS
from mapmore_cli.ingestion.samples import Samples
from mapmore_cli.storage.tables.cells import NotANumber
from mapmore_cli.study.campaign import load_campaign

K = np.arange(30.0)
COLUMNS = {"time": {"column": "t"}, "u": {"column": "u"}}
OWN = {"pressure": {"column": "F", "unit": "bar"}}
BARE = Draft({"name": "a", "data": {"columns": COLUMNS, "missing": "drop"}})


# The draft is tried with the rules of `check`
# --------------------------------------------------------------------------------------------------


def few(folder, count, most, monkeypatch, **more):
    """The draft of so many files at two levels, which call the column of the pressure `F`."""
    for number in range(count):
        write(folder / f"{number}.csv", {"t": K, "P": K + number})
    monkeypatch.setattr(checks, "MOST", most)
    files = [
        {"path": f"{number}.csv", "set": {"load": number % 2}, "columns": OWN}
        for number in range(count)
    ]
    columns = {"time": {"column": "t"}, "pressure": {"column": "P"}}
    data = {"files": files, "reader": "csv", "columns": columns, **more}
    draft = Draft({"data": data})
    found, number = with_few_files(draft, folder)
    assert number == count
    return None if found is draft else found.data


@pytest.mark.parametrize(
    ("count", "most", "drawn"), [(3, 3, None), (4, 3, 3), (4, 2, 2), (4, 1, None)]
)
def test_files_are_drawn_if_there_are_more_than_can_be_examined(
    tmp_path, monkeypatch, count, most, drawn
):
    """One of each level at least, unless there are more levels than files that can be drawn."""
    found = few(tmp_path, count, most, monkeypatch)
    assert (None if found is None else len(found["files"])) == drawn
    if found is not None:
        assert {one["set"]["load"] for one in found["files"]} == {0, 1}
        paths = [one["path"] for one in found["files"]]
        assert paths == sorted(paths)
        assert all(one["columns"] == OWN for one in found["files"])


def test_no_files_are_held_out_by_name_if_only_some_are_drawn(tmp_path, monkeypatch):
    for held_out in ({"recordings": ["0"]}, {"files": ["0.csv"]}, {"last": 0.3}):
        split = {"validate": held_out}
        found = few(tmp_path, 4, 3, monkeypatch, split=split)
        assert ("split" in found) == ("last" in held_out)


WRONG, BROKEN = SpecError("it is wrong", "mend it"), DataError("it is broken", "measure again")
PLAIN, PLAINER = (replace(BARE, spec={**BARE.spec, "name": name}) for name in ("plain", "plainer"))


@pytest.mark.parametrize(
    ("faults", "name", "why"),
    [
        ({}, "a", None),
        ({"a": BROKEN}, "plain", "simplified"),
        ({"a": WRONG, "plain": BROKEN}, "plainer", "simplified"),
        ({"a": WRONG, "plain": BROKEN, "plainer": BROKEN}, "a", "`check` finds an error: it is wr"),
        ({"a": BROKEN, "plain": WRONG, "plainer": WRONG}, None, None),
    ],
)
def test_the_first_draft_without_an_error_is_taken(monkeypatch, faults, name, why):
    monkeypatch.setattr(checks, "with_few_files", lambda draft, _: (draft, 1))
    monkeypatch.setattr(checks, "_fault", lambda draft, _: faults.get(draft.name))
    if name is None:
        with refused("a: it is broken", "measure again"):
            checked(BARE, (PLAIN, PLAINER), Path())
        return
    found = checked(BARE, (PLAIN, PLAINER), Path())
    assert (found.name, ("data", "files") in found.notes) == (name, False)
    assert [*found.open] == ([] if why is None else [("target",)])
    assert why is None or found.open["target",].why.startswith(why)


def test_a_note_says_how_many_files_were_examined(monkeypatch):
    monkeypatch.setattr(checks, "with_few_files", lambda draft, _: (replace(draft), 999))
    monkeypatch.setattr(checks, "_fault", lambda *_: None)
    told = "`check` examined 300 of 999 files, drawn at random"
    assert checked(BARE, (), Path()).notes["data", "files"] == Note(told)
    noted = checked(BARE.noted(("data", "files"), "names", sure=False), (), Path())
    assert noted.notes["data", "files"] == Note(f"names; {told}", sure=False)


@pytest.mark.parametrize(
    ("severities", "training", "more", "fault"),
    [
        ((), (5, 0), {}, None),  # the search needs five training samples in one of the curves
        ((), (4, 4), {}, DataError),
        ((), (4, 4), {"dictionary": []}, None),
        (("warning",), (5,), {}, None),
        (("warning", "error"), (5,), {}, SpecError),
    ],
)
def test_the_errors_of_check_and_too_few_samples_are_faults(
    monkeypatch, severities, training, more, fault
):
    issue = SimpleNamespace(message="", id="x", remedy="", cause="spec")
    issues = [SimpleNamespace(**{**vars(issue), "severity": one}) for one in severities]
    curves = [SimpleNamespace(training=np.arange(9) < count) for count in training]
    monkeypatch.setattr(checks, "load_text", lambda *_: SimpleNamespace(spec=None))
    monkeypatch.setattr(checks, "slice_of", lambda _: None)
    monkeypatch.setattr(checks, "build_dataset", lambda *_: SimpleNamespace(curves=curves))
    monkeypatch.setattr(checks, "issues_of", lambda *_: issues)
    found = checks._fault(replace(BARE, spec={**BARE.spec, **more}), Path())
    assert (None if found is None else type(found)) == fault


# Files and clocks that cannot be read
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("is_joined", [False, True])
@pytest.mark.parametrize("is_most", [False, True])
def test_ways_to_read_a_folder_in_their_order(monkeypatch, is_joined, is_most):
    """First the gaps, then files, then both, then the clock, then the clock and files. A way that
    leaves out most files is taken only if no other one is left.
    """
    ways, minute = [], {"longer_than": 60.0, "action": "split"}

    def read(draft, _folder, _target):
        data = draft.data
        assert data.get("gaps", minute) == minute
        ways.append(("gaps" in data, data.get("skip_bad_files", False), "time" in data["columns"]))
        if len(ways) < 3:
            raise DataError("a.csv: is wrong")
        return draft, [], is_most

    monkeypatch.setattr(cleaning, "_read_tolerantly", read)
    draft = BARE.with_data("join", []) if is_joined else BARE
    expected = [(False, False, True), (True, False, True), (False, True, True), (True, True, True)]
    if not is_joined:
        expected += [(False, False, False), (False, True, False)]
    found, _ = cleaning.cleaned(draft, Path(), "u")
    assert ways == (expected[:3] if is_most else expected)
    is_clock_left_out = not (is_joined or is_most)
    assert ("time" in found.data["columns"]) != is_clock_left_out
    assert (("data", "columns") in found.open) == is_clock_left_out


@pytest.mark.parametrize(
    ("skip", "names", "is_most", "bad"),
    [
        (False, "abcd", True, None),
        (True, "ab", True, ["c.csv", "d.csv"]),  # half of the files
        (True, "a", False, ["b.csv", "c.csv", "d.csv"]),
    ],
)
def test_files_without_a_recording_are_left_out_by_name(
    monkeypatch, tmp_path, skip, names, is_most, bad
):
    for name in "abcd":
        write(tmp_path / f"{name}.csv", {"t": K, "u": K})
    found = SimpleNamespace(recordings=[recording(name, u=K) for name in names], notes=[])

    def read(_draft, _folder, _target, warn):
        for warning in ("c.csv: is left out as a bad file: why", "b.csv: something else"):
            warn(warning)
        return found

    monkeypatch.setattr(cleaning, "read_draft", read)
    draft = BARE.with_data("files", ["*.csv"])
    for key, value in (("repeated_time", "spread"), ("glitches", "drop"), ("skip_bad_files", skip)):
        draft = draft.with_data(key, value)
    draft, recordings, is_enough = cleaning._read_tolerantly(draft, tmp_path, "u")
    assert (recordings, is_enough) == (found.recordings, is_most)
    assert draft.data["skip_bad_files"] == (bad or False)
    assert draft.bad_files == ("c.csv: is left out as a bad file: why" if skip else "")


@pytest.mark.parametrize("is_joined", [False, True])
def test_settings_that_no_sample_needs_are_removed_and_others_say_how_many_need_them(is_joined):
    """The samples of a joined log are not counted, so that its settings stay."""
    kept = {"missing": "drop", "repeated_time": "spread", "glitches": "drop"}
    draft = cleaning.lenient(Draft({"data": {"glitches": "error"}}))
    assert draft.data == {**kept, "glitches": "error"}
    draft = cleaning.lenient(Draft({"data": {"join": []} if is_joined else {}}))
    assert draft.data == draft.data | kept

    def found(notes=(), **dropped):
        recordings = [
            SimpleNamespace(dropped={key.replace("_", " "): n for key, n in dropped.items()})
        ]
        dataset = SimpleNamespace(recordings=2 * recordings, notes=notes)
        return cleaning._with_losses(draft, dataset)

    nothing = found(("a.csv: something else",))
    assert ({*kept} & {*nothing.data}, nothing.notes) == ({*kept} if is_joined else set(), {})
    for key, one in (
        ("missing", found(missing_value=3)),
        ("glitches", found(glitch_of_the_clock=3)),
        ("repeated_time", found([f"a.csv: {k} {REPEATS}, and are spread" for k in (4, 2)])),
    ):
        assert ({*kept} & {*one.data}) == ({*kept} if is_joined else {key})
        assert [*one.notes] == [("data", key)]
        assert one.notes["data", key].why.startswith("6 ")
        assert one.notes["data", key].sure
    draft = draft.with_data("missing", {"tokens": ["OVLD", "--"]})
    note = found(missing_value=1).notes["data", "missing"]
    assert not note.sure
    assert note.why.startswith("2 samples have a cell that is empty or holds 'OVLD', '--'")


def samples(**columns):
    return Samples({name: np.array(x) for name, x in columns.items()}, range(2), "a.csv")


def test_a_column_that_is_empty_in_half_of_the_files_is_not_read():
    """If it is empty in fewer files, these files are not read."""
    full, empty = samples(x=[1.0, np.nan], y=[1.0, 2.0]), samples(x=[np.nan] * 2, y=[1.0, 2.0])
    assert drafts._without_bad([full, empty]) == [full, empty]
    assert drafts._without_bad([full, full, empty]) == [full, full]


@pytest.mark.parametrize(("bad", "count"), [(1, 2), (1, 3), (2, 4), (2, 5)])
def test_a_few_files_are_read_if_more_than_half_of_them_can_be(monkeypatch, tmp_path, bad, count):
    for number in range(count):
        write(tmp_path / f"{number}.csv", {"u": K + number})

    def read(source, *_):
        if int(source.id) < bad:
            raise DataError(f"{source.name}: is wrong")
        return [samples(column_0=[1.0, 2.0])]

    monkeypatch.setattr(drafts, "read_tables", read)
    section = {"files": ["*.csv"], "reader": "csv"}
    if 2 * bad == count:
        with refused("0.csv: is wrong"):
            drafts._read_columns(section, tmp_path, ("u",))
    else:
        assert len(drafts._read_columns(section, tmp_path, ("u",))["u"]) == count - bad


@pytest.mark.parametrize(
    ("cell", "is_known", "is_told"),
    [
        *(
            ("", True, True),
            ("#REF!", True, True),
            ("Err:502", True, True),
            ("-1.5 kPa", True, True),
        ),
        *(("3 of 5", True, False), ("kPa", False, False)),
    ],
)
def test_why_a_column_of_formulas_or_units_cannot_be_read(
    monkeypatch, tmp_path, cell, is_known, is_told
):
    write(tmp_path / "a.csv", {"u": K, "bad": K})
    study = FolderStudy((tmp_path / "a.csv",), FileLayout("csv", *2 * [("u", "bad")], {}, (), (0,)))

    def read(_section, _folder, columns):
        if "bad" in columns:
            raise NotANumber(cell, "is no number", "mend it", known=is_known)
        return {column: [K] for column in columns}

    monkeypatch.setattr(drafts, "_read_columns", read)
    bad = table_of(study, tmp_path)["bad"]
    assert len(bad.values) == 0
    assert bad.unread.endswith("; mend it") == is_told
    assert bool(bad.unread) == is_told
    everything = replace(study, layout=replace(study.layout, numeric=(0, 1)))
    with refused("is no number") if is_known else nullcontext():
        table_of(everything, tmp_path)


@pytest.mark.parametrize("is_empty", [False, True])
def test_texts_and_numbers_of_a_column_stand_in_every_file(tmp_path, is_empty):
    for number in range(2):
        is_full = not (is_empty and number)
        cells = ([k, k * k, k % 7 + number, "ab"[k % 2]] for k in range(9))
        rows = [row if is_full else [*row[:2], "", ""] for row in cells]
        lines = [",".join(map(str, row)) for row in [["t", "v", "u", "state"], *rows]]
        (tmp_path / f"{number}.csv").write_text("\n".join([*lines, ""]))
    ((study,), _) = find_studies(tmp_path)
    table = table_of(study, tmp_path)
    assert bool(table["u"].values) != is_empty
    assert bool(table["state"].texts) != is_empty


@pytest.mark.parametrize(
    ("states", "is_text"),
    [
        *(("abab", True), ("aba", False)),  # each text stands in two rows on average
        *(("a    b    ", True), ("a    b   ", False), ("a         ", False)),  # in five rows
        *((" a    b    ", False), ("abcdefabcdef", True), ("abcdefabcde", False)),
    ],
)
def test_texts_of_a_column_repeat(tmp_path, states, is_text):
    """A text also describes the empty cells below it, if it stands in the first row."""
    rows = [f"{k},{k * k},{state}" for k, state in enumerate(states)]
    (tmp_path / "a.csv").write_text("\n".join(["t,v,state", *rows, ""]))
    ((study,), _) = find_studies(tmp_path)
    assert bool(table_of(study, tmp_path)["state"].texts) == is_text


# The files of a study
# --------------------------------------------------------------------------------------------------


def test_a_glob_may_match_bad_files(tmp_path):
    for name in "abc":
        write(tmp_path / f"run_{name}.csv", {"u": K})
    (tmp_path / "run_c.csv").write_text("")
    files = [tmp_path / f"run_{name}.csv" for name in "ab"]
    assert patterns(files, tmp_path, [tmp_path / "run_c.csv"]) == ["run_*.csv"]
    assert patterns(files, tmp_path) == ["run_a.csv", "run_b.csv"]


def test_a_draft_names_bad_files_and_doubts_about_names(tmp_path):
    names = ("b0", "m1", "q2")
    for number, name in enumerate(names):
        write(tmp_path / f"{name}.csv", {"t [s]": K, "P [kPa]": K + number})
    (tmp_path / "e.csv").write_text("")
    (tmp_path / "zzz.csv").write_text((tmp_path / "b0.csv").read_text())
    (study,), _ = find_studies(tmp_path)
    certain = NamedCondition("load", "", (1, 1, 1), "load 1")
    draft = started(study, tmp_path, [certain, replace(certain, quantity="mass", sure=False)])
    assert not draft.notes["data", "files"].sure
    assert started(study, tmp_path, [certain]).notes["data", "files"].sure
    assert draft.data["skip_bad_files"] == ["e.csv", "zzz.csv"]
    assert draft.notes["data", "skip_bad_files"].why.startswith("e.csv: is empty")
    assert ("data", "header") not in draft.notes
    assert started(study, tmp_path).data["files"] == ["*.csv"]
    (tmp_path / "zzz.csv").unlink()
    for number, name in enumerate(names):
        write(tmp_path / f"{name}.csv", {"t [s]": K, "P [kPa]": K + number}, "")
    (study,), _ = find_studies(tmp_path)
    assert ("data", "header") in started(study, tmp_path).notes


def test_files_whose_columns_have_another_order_are_sorted_among_the_others(tmp_path, monkeypatch):
    columns = {"t [s]": K, "P [kPa]": K**2, "F [N]": -K}
    for name in "abc":
        own = [*columns.items()][:: -1 if name == "b" else 1]
        write(tmp_path / f"rig/{name}.csv", {title: x + ord(name) for title, x in own})
    (tmp_path / "rig/e.csv").write_text("")
    (tmp_path / "rig/d.csv").write_text("")
    found = Path.rglob
    monkeypatch.setattr(Path, "rglob", lambda *how: sorted(found(*how), reverse=True))
    ((study,), reasons) = find_studies(tmp_path)
    assert [file.stem for file in study.files] == ["a", "b", "c"]
    assert [file.stem for file in study.variants] == ["b"]
    assert [reason.partition(":")[0] for reason in reasons] == ["d.csv", "e.csv"]
    assert study.name == "rig"


@pytest.mark.parametrize(("tables", "examined"), [((), "abd"), ((1, 2), "abcd")])
def test_of_files_with_equal_kinds_of_lines_only_the_first_is_examined(
    monkeypatch, tables, examined
):
    """Unless they hold several tables, which may differ beyond the first lines."""
    seen = []
    layout = FileLayout("csv", (), (), {}, (), (), tables=tables)
    kinds = {"a": (b"1",), "b": (b"2",), "c": (b"1",), "d": (), "e": ()}

    def look(file):
        seen.append(file.stem)
        if file.stem == "e":
            raise DataError("e: is wrong")
        return layout

    monkeypatch.setattr(studies, "preview", look)
    monkeypatch.setattr(studies, "kinds_of_lines", lambda file: kinds[file.stem])
    paths = [Path(f"{name}.csv") for name in kinds]
    found, faults = studies._layouts_of(paths)
    assert (found, faults) == (dict.fromkeys(paths[:4], layout), {paths[4]: "e: is wrong"})
    assert seen == [*examined, "e"]


@pytest.mark.parametrize(
    ("titles", "count"),
    [
        (("P [bar]", "P [kPa]"), 1),
        (("P", "P [kPa]"), 2),
        (("bend [deg]", "bend [rad]"), 2),
        (("bend", "bend [V]"), 2),
    ],
)
def test_files_of_one_study_differ_only_in_the_unit_of_a_known_quantity(tmp_path, titles, count):
    for number, title in enumerate(titles):
        write(tmp_path / f"{number}.csv", {title: K + number, "u": K})
    assert len(find_studies(tmp_path)[0]) == count


@pytest.mark.parametrize(
    ("said", "target", "derived"),
    [
        ({"target": "F"}, "static", False),
        ({"target": "F", "length": "80mm"}, "static", True),
        ({"target": "x", "inputs": "P", "length": "80mm"}, "strain", True),
    ],
)
def test_with_a_length_the_strain_is_modelled_instead_of_the_displacement(
    tmp_path, said, target, derived
):
    wave = np.sin(np.append(K, 2 * K))
    write(tmp_path / "a.csv", {"P [kPa]": wave, "x [mm]": wave**3, "F [N]": wave**2})
    (draft,) = start(tmp_path, tmp_path, answers=answers_of(**said)).drafts
    assert draft.spec["target"] == target
    assert ("derive" in draft.data) == derived


@pytest.mark.parametrize(
    ("files", "layout", "above", "names"),
    [
        ("a", {}, ((),), ["a"]),
        ("ab", {}, ((), ()), ["a", "b"]),
        ("a", {"tables": (1, 3)}, (("5 mm", ""),), ["5 mm", "a"]),
        ("ab", {"tables": (1, 3)}, (("x", "y"), ("", "z")), ["a x", "a y", "b", "b z"]),
        ("a", {"alike": ("one", "two")}, ((),), ["one", "two"]),
        ("ab", {"alike": ("one", "two")}, ((), ()), ["a", "b"]),  # sheets have the same role
        ("ab", {"alike": ("1", "2"), "left": ("3",)}, ((), ()), ["a", "a", "b", "b"]),
    ],
)
def test_recordings_are_called_by_their_files_tables_and_sheets(files, layout, above, names):
    paths = tuple(Path(f"in/{name}.csv") for name in files)
    study = FolderStudy(
        paths,
        FileLayout("csv", (), (), {}, (), (), **layout),
        above=dict(zip(paths, above, strict=True)),
    )
    assert (study.names, len(study.parts)) == (names, len(names))
    assert str(study) == ("1 file" if files == "a" else "2 files")


def test_a_file_has_columns_of_its_own_if_a_title_or_unit_differs():
    usual, other = Path("a.csv"), Path("b.csv")

    def layout(*titles):
        return FileLayout("csv", titles, titles, {}, (), (0, 1, 2))

    mine = layout("t [s]", "P [bar]", "T [degC]", "day")
    theirs = layout("T [degC]", "t [s]", "P [kPa]", "day")
    study = FolderStudy((usual, other), mine, variants={other: theirs})
    columns = {"time": NamedColumn("t [s]", "s"), "pressure": NamedColumn("P [bar]", "bar")}
    columns |= {"T": NamedColumn("T [degC]", "degC"), "day": NamedColumn("day", texts=True)}
    changed = {"pressure": {"column": "P [kPa]", "unit": "kPa"}}
    assert study.changed_columns(columns) == {other: changed}
    pressure = {"pressure": replace(columns["pressure"], scale=2.0)}
    assert study.changed_columns(pressure)[other]["pressure"]["scale"] == 2
    parts = NamedColumn("P [bar]", "s", parts={"P [bar]": "s", "T [degC]": "ms"})
    assert study.changed_columns({"time": parts}) == {}


def test_columns_without_a_title_must_stand_at_the_same_place(tmp_path):
    rows = "".join(f"{k},{k * k},{k**3}\n" for k in range(30))
    for name, titles in (("a", "t [s],,F [N]"), ("b", "t [s],F [N],")):
        (tmp_path / f"{name}.csv").write_text(f"{titles}\n{rows}")
    assert len(find_studies(tmp_path)[0]) == 2


def test_a_single_file_gives_its_name_to_the_study(tmp_path):
    wave = np.sin(K)
    write(tmp_path / "rig/pull.csv", {"P [kPa]": wave, "F [N]": wave**2, "x [mm]": wave**3})
    told = []
    for target, names in (("F", ["pull"]), ("F,x", ["pull-force", "pull-displacement"])):
        found = start(tmp_path, tmp_path, answers=answers_of(target=target), tell=told.append)
        assert [draft.name for draft in found.drafts] == names
    assert told == []  # there is only one layout


def test_copies_are_equal_beyond_their_beginnings(tmp_path, monkeypatch):
    monkeypatch.setattr(studies, "HEAD", 4)
    paths = [tmp_path / name for name in ("a", "b", "c1")]
    for path, text in zip(paths, ("t,u\n1,2\n", "t,u\n1,3\n", "t,u\n1,2\n"), strict=True):
        path.write_text(text)
        os.utime(path, ns=(0, 0))
    assert studies._copies(paths) == {paths[2]: paths[0]}


def test_a_folder_without_recordings_is_refused_with_the_endings_that_are_read(tmp_path):
    with pytest.raises(DataError) as caught:
        start(tmp_path, tmp_path)
    endings = caught.value.remedy.partition("endings ")[2].split()
    assert endings == sorted(endings)
    assert {".csv", ".xlsx"} < {*endings}


# A second log
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("is_shifted", "shift"), [(True, "auto"), (False, 0.0)])
def test_a_second_log_is_interpolated_over_five_of_its_steps(monkeypatch, is_shifted, shift):
    """Repeated stamps are no steps."""
    columns = {"time": NamedColumn("ms", "ms"), "pressure": NamedColumn("p", "bar", "why")}
    clock = SimpleNamespace(column="ms", title="", values=[np.repeat(100.0 * np.arange(9), 3)])
    monkeypatch.setattr(second_log, "table_of", lambda *_: {"ms": clock})
    monkeypatch.setattr(second_log, "known_by_titles", lambda _: (columns, {}))
    monkeypatch.setattr(second_log, "started", lambda *_: SimpleNamespace(data={"files": ["b"]}))

    def read(draft, _folder, target):
        (join,) = draft.data["join"]
        assert (join["shift"], join["match"]["first"], target) == ("auto", "F", "F")
        if not is_shifted:
            raise DataError("another shift is nearly as good")
        return SimpleNamespace(notes=["a: something", "b.csv: shift -3 s, found from p and F"])

    monkeypatch.setattr(second_log, "read_draft", read)
    draft = second_log.with_second_log(BARE, SimpleNamespace(files=[]), Path(), "F", {})
    (join,) = draft.data["join"]
    assert (join["files"], join["shift"], join["max_gap"]) == (["b"], shift, 0.5)
    assert ("match" in join) == is_shifted
    note = draft.notes["data", "join"]
    assert note.sure == is_shifted
    assert ("shift -3 s" in note.why) == is_shifted


# The files that are written
# --------------------------------------------------------------------------------------------------


def test_specs_that_exist_are_named_in_order_after_the_others_were_written(tmp_path):
    draft = BARE.with_section("target", "u")
    paths = [tmp_path / f"{name}.yaml" for name in "hgfedcba"]
    for path in paths[1:]:
        path.write_text("own")
    reporter = SimpleNamespace(say=lambda _: None)
    files = {path: (draft.text(), draft) for path in paths}
    names = ", ".join(f"{tmp_path}/{name}.yaml" for name in "abcdefg")
    with refused(f"{names}: already exists", error=WriteError):
        commands._write(files, False, reporter)
    assert [path.read_text() == "own" for path in paths] == [False, *[True] * 7]
    commands._write(files, True, reporter)
    assert all(path.read_text() == draft.text() for path in paths)
    foreign = tmp_path / "recording.csv"
    foreign.write_text("t,u\n1,2\n")
    with refused("recording.csv", error=WriteError):
        commands._refuse([foreign], force=True)


def test_one_spec_is_written_to_the_standard_output_but_not_two(tmp_path, capsys):
    wave = np.sin(np.append(K, 2 * K))
    write(tmp_path / "a.csv", {"u": wave, "F [N]": wave**2, "x [mm]": wave**3})
    init(tmp_path, output=STANDARD, target="F", yes=True)
    assert "\ntarget: static\n" in capsys.readouterr().out
    with pytest.raises(UsageError, match="2 specs cannot be written as one text"):
        init(tmp_path, output=STANDARD, target="F,x", yes=True)


def test_without_options_the_clock_is_used_nothing_is_replaced_and_a_person_is_asked(
    tmp_path, capsys, monkeypatch
):
    wave, asked = np.sin(np.append(K, 2 * K)), []
    columns = {"t [s]": np.arange(60.0), "u": wave, "F [N]": wave**2}
    write(tmp_path / "a.csv", columns)
    spec = tmp_path / "spec.yaml"
    monkeypatch.setattr(commands, "ask", lambda question: asked.append(question.text) or "")
    init(tmp_path, output=spec, target="F")
    assert asked == []  # this is no terminal
    assert "    time: " in spec.read_text()
    assert f"Next: mapmore check {spec}" in capsys.readouterr().err
    with refused("already exists", error=WriteError):
        init(tmp_path, output=spec, target="F")
    for stream in ("stdin", "stderr"):
        monkeypatch.setattr(getattr(sys, stream), "isatty", lambda: True, raising=False)
    for more in ({"yes": True}, {"quiet": True}, {}):
        assert asked == []
        init(tmp_path, output=spec, target="F", force=True, **more)
    assert asked != []


def test_every_layout_gets_a_draft_unless_one_is_wanted(tmp_path):
    wave = np.sin(np.append(K, 2 * K))
    write(tmp_path / "a.csv", {"u": wave, "F [N]": wave**2})
    write(tmp_path / "b.csv", {"u": wave, "n": wave**3, "F [N]": wave**2})
    answers = answers_of(target="F")
    assert len(start(tmp_path, tmp_path, answers=answers).drafts) == 2
    one = start(tmp_path, tmp_path, single=True, answers=answers)
    assert len(one.drafts) == 1
    assert any("another study" in remark for remark in one.remarks)


def test_a_campaign_has_a_spec_of_each_output_that_extends_what_they_share(tmp_path):
    columns = {name: {"column": name} for name in ("u", "y", "z")}
    parts = {name: {key: columns[key] for key in ("u", name)} for name in ("y", "z")}
    own = {"y": {"units": {"y": "mm"}}, "z": {}}
    outputs = [
        Draft(
            {"name": f"rig-{name}", "target": name, **own[name]}
            | {"data": {"files": ["a.csv"], "columns": parts[name]}},
            of="rig",
        )
        for name in parts
    ]
    single = replace(BARE, spec={**BARE.spec, "target": "u"})
    files = as_files([*outputs, single], None)
    assert [str(path) for path in files] == [
        *("rig.yaml", "_rig.yaml", "rig-y.yaml", "rig-z.yaml", "a.yaml"),
    ]
    texts = {path.stem: yaml.safe_load(text) for path, (text, _) in files.items()}
    assert texts["a"] == single.spec
    assert texts["_rig"] == {
        "data": {"files": ["a.csv"], "columns": {"u": {"column": "u"}}},
        "units": {},
    }
    for name in ("y", "z"):
        rest = {"name": f"rig-{name}", "target": name, "data": {"columns": {name: columns[name]}}}
        assert texts[f"rig-{name}"] == {"extends": "_rig.yaml", **rest, **own[name]}
    for path, (text, _) in files.items():
        (tmp_path / path).write_text(text)
    campaign, _ = load_campaign(tmp_path / "rig.yaml")
    assert campaign.campaign == "rig"
    assert [run.base for run in campaign.runs] == ["rig-y.yaml", "rig-z.yaml"]
    assert [*as_files(outputs, tmp_path / "x.yaml")][2] == tmp_path / "x-y.yaml"
