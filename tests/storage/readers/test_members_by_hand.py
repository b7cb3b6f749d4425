"""Addresses, elements and clocks of files that hold trees, by hand."""

from time import process_time

import numpy as np
import pytest

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import Noted, TableRequest
from mapmore_cli.storage.tables.cells import CellReader
from mapmore_cli.storage.tables.members import (
    Member,
    array_of,
    as_numbers,
    group_of,
    parse_address,
    refuse_other_clocks,
    size_in_words,
    tables,
)
from mapmore_cli.storage.tables.overview import (
    TreeMember,
    _columns_of,
    _first_recording,
    _places,
    _title_of,
    first_rows,
)

WHOLE, PLAIN = slice(None), CellReader()


@pytest.mark.parametrize(
    ("text", "steps"),
    [
        *(("run.P", ("run", "P")), ("a/b c", ("a", "b c")), ("y[:,0]", ("y", (WHOLE, 0)))),
        *(("t[3].y[ 1 , : ]", ("t", (3,), "y", (1, WHOLE))), ("[2]", ((2,),)), ("", ())),
    ],
)
def test_addresses_are_names_and_indices(text, steps):
    assert parse_address(text) == steps
    assert parse_address(f"xx{text}", 2) == steps


@pytest.mark.parametrize(
    "text", ["a..b", "a.", "a[", "a[]", "a[-1]", "a[1.5]", "a[x]", "a[0,x]", "a.[1]", "a]"]
)
def test_other_addresses_are_refused(text):
    with pytest.raises(DataError, match="not a valid"):
        parse_address(text)


def numbers(values, **noted):
    array = np.asarray(values)
    return array_of(lambda selection: array[selection or ...], array.shape, Noted(**noted))


def tree(members):
    return group_of("a group", list(members), lambda name: members[name])


def test_sizes_and_order_of_members():
    assert [size_in_words(shape) for shape in ((), (3,), (3, 2))] == [
        "a single value",
        "3",
        "3 x 2",
    ]
    group = tree({f"run_{n}": numbers([float(n)]) for n in (10, 2, 1)})
    assert [group.element(i).values(())[0] for i in range(3)] == [1, 2, 10]
    assert [group.is_array, numbers([1]).is_array, Member("x", count=0).is_array] == [0, 1, 0]


RUNS = {
    "run_2": tree({"x": numbers([3.0, 4.0]), "y": numbers([5.0, 6.0])}),
    "run_10": tree({"x": numbers([7.0, 8.0]), "y": numbers([9.0, 1.0])}),
    "about": tree({"fs": numbers(100.0)}),
}


def test_every_element_is_a_recording_if_it_has_one_of_the_columns():
    found = tables(tree({"runs": tree(RUNS)}), TableRequest("a.mat", ("x",), root="runs[*]"))
    assert [one.columns["x"].tolist() for one in found] == [[3, 4], [7, 8]]
    assert [one.element for one in found] == [1, 2]
    assert found[0].doubts == (
        "a.mat:runs: 1 of 3 members have none of the columns, and are left out; check `root` and "
        "the names of the columns",
    )
    assert found[1].doubts == ()
    assert [*found[0].rows] == [0, 1]
    (one,) = tables(tree(RUNS), TableRequest("a.mat", ("run_2.y", "run_10/y")))
    assert (one.columns["run_2.y"].tolist(), one.columns["run_10/y"].tolist()) == ([5, 6], [9, 1])
    (one,) = tables(tree(RUNS), TableRequest("a.mat", ("y",), root="run_2"))
    assert (one.label, one.element) == ("a.mat:run_2", None)
    matrix = tree({"z": numbers([[1.0, 2.0], [3.0, 4.0]])})
    assert tables(matrix, TableRequest("a", ("z[:,1]",)))[0].columns["z[:,1]"].tolist() == [2, 4]
    assert tables(matrix, TableRequest("a", ("z[1,:]",)))[0].columns["z[1,:]"].tolist() == [3, 4]
    (column,) = tables(matrix, TableRequest("a", (1,), root="z"))
    assert column.columns[1].tolist() == [2, 4]
    dotted = tree({"a.b": numbers([1.0]), "a": tree({"b": numbers([2.0])})})
    assert tables(dotted, TableRequest("a", ("a.b",)))[0].columns["a.b"].tolist() == [1]


@pytest.mark.parametrize(
    ("column", "root", "words"),
    [
        *(
            ("z", "runs[3]", "no element 3 on the way"),
            ("run_2", "runs", "is a group, not an array"),
        ),
        *(("run_2.q", "runs", "there is no 'q' on the way to 'run_2.q'"), ("q", "runs", "no 'q'")),
        *(("z", None, "array of 2 x 2"), ("z[:,2]", None, "reaches beyond an array of 2 x 2")),
        *(("empty", None, "'empty' is empty"), ("", None, "empty address")),
        ("x", "z[*]", "asks for every element of an array of 2 x 2"),
    ],
)
def test_addresses_that_lead_nowhere(column, root, words):
    top = {"runs": tree(RUNS), "z": numbers([[1.0, 2.0], [3.0, 4.0]]), "empty": numbers([])}
    with pytest.raises(DataError) as error:
        tables(tree(top), TableRequest("a", (column,), root=root))
    assert words in error.value.message


def test_columns_of_different_length_are_cut_to_the_shortest():
    top = tree({"x": numbers([1.0, 2.0, 3.0]), "y": numbers([4.0, 5.0])})
    (table,) = tables(top, TableRequest("a", ("x", "y")))
    assert [one.tolist() for one in table.columns.values()] == [[1, 2], [4, 5]]
    assert "'y' has 2 samples, 'x' has 3" in table.breaks_off.said
    assert table.breaks_off.rows == 0
    room = tree({"x": numbers([1.0], never_written=2), "y": numbers([1.0], never_written=3)})
    assert "3 values of 'y'" in tables(room, TableRequest("a", ("x", "y")))[0].breaks_off.said
    assert tables(tree({"x": numbers([1.0])}), TableRequest("a", ("x",)))[0].breaks_off is None


@pytest.mark.parametrize(
    ("step", "start", "words"),
    [
        *((0.1, 5.0, ""), (0.1 * (1 + 0.9e-6), 5.0, ""), (0.1, 5.001, ""), (0.0, 9.0, "")),
        *((0.1 * (1 + 1.1e-6), 5.0, "sampled every 0.1 s"), (0.2, 5.0, "'y' every 0.2 s")),
        *((0.1, 5.0011, "begins 0.0011 s after 'x'"), (0.1, 4.9989, "begins -0.0011 s")),
    ],
)
def test_columns_of_one_clock_agree_within_a_hundredth_of_a_step(step, start, words):
    noted = {"note": Noted(), "x": Noted(step=0.1, start=5.0), "y": Noted(step=step, start=start)}
    if not words:
        refuse_other_clocks(noted, "a")
        return
    with pytest.raises(DataError) as error:
        refuse_other_clocks(noted, "a")
    assert words in error.value.message
    assert f"`shift: {round(start - 5, 6):.9g} s`" in error.value.remedy


def test_stamps_and_durations_are_in_the_unit_of_the_column():
    clock = CellReader(clock=True, second=1000.0)
    stamps = np.array(["1970-01-01T00:00:02.5", "NaT"], "datetime64[ms]")
    np.testing.assert_array_equal(as_numbers(stamps, "a", clock), [2500, np.nan])
    assert as_numbers(np.timedelta64(90, "m"), "a", CellReader(clock=True)) == 5400
    for array, word in ((stamps, "a date"), (np.array([1], "m8[s]"), "a duration")):
        with pytest.raises(DataError, match=f"a: {word}, not a number"):
            as_numbers(array, "a", PLAIN)
    for array, word in (([1j], "complex"), ([True], "TRUE"), (np.zeros(1, "V4"), "references")):
        with pytest.raises(DataError, match=f"a holds {word}"):
            as_numbers(array, "a", PLAIN)
    texts = np.array([["1", "2.5"], ["1", ""]])
    np.testing.assert_array_equal(as_numbers(texts, "a", PLAIN), [[1, 2.5], [1, np.nan]])
    grouped = np.array(["950", "1.050"])
    assert as_numbers(grouped, "a", CellReader(thousands="'")).tolist() == [950, 1.05]
    with pytest.raises(DataError, match="may be 1050"):
        as_numbers(grouped, "a", PLAIN)
    with pytest.raises(DataError, match="a holds text, not real numbers: index 2"):
        as_numbers(np.array(["1", "1", "b"]), "a", PLAIN)


def test_a_survey_is_of_five_hundred_members_and_tables_of_64_columns():
    group = tree({f"v{n}": numbers([1.0, 2.0]) for n in range(600)})
    places = _places(group, "/")
    assert (len(places), places[1].address, places[-1].address) == (501, "v0", "v499")
    for shape, count in (((100, 64), 64), ((64, 100), 64), ((100, 65), 0), ((65, 65), 0)):
        columns = [*_columns_of(TreeMember("m", "m", "", numbers(np.ones(shape))), 5)]
        assert len(columns) == count
    for shape in ((), (1,), (1, 1)):
        (single,) = _columns_of(TreeMember("m", "m", "", numbers(np.full(shape, 7.0))), 5)
        assert (single.length, single.values.tolist()) == (1, [7])
        assert all((one.length, one.values.size) == (100, 5) for one in columns)


def test_the_name_of_a_quantity_stands_beside_its_values():
    def text(word):
        return Member("text", values=lambda _: np.array([word]))

    named = tree({"values": numbers([1.0]), "time": numbers([1.0]), "name": text("F")})
    assert [_title_of(named, name, "v") for name in ("values", "time")] == ["F", "time"]
    signal = {"values": numbers([1.0]), "dimensions": numbers(1.0), "blockName": text("rig/F")}
    assert [_title_of(tree(signal), name, "v") for name in signal] == ["F", *[*signal][1:]]
    assert _title_of(tree({**signal, "label": text("P")}), "values", "v") == "P"
    assert _title_of(tree({**signal, "blockName": text("")}), "values", "v") == "v"


@pytest.mark.parametrize(("beside", "is_one"), [([[7.0]], True), ([[1.0, 2.0, 3.0]], False)])
def test_groups_beside_columns_are_no_recordings(beside, is_one):
    """But they may stand beside single values, for example of settings."""
    log = tree({"x": numbers([1.0, 2.0]), "y": numbers([3.0, 4.0])})
    first = _first_recording(tree({"a": numbers(beside), "run_1": log, "run_2": log}))
    assert (first is log) is is_one
    cells = Member("a cell array of 2", count=2, element=[log, numbers([1.0])].__getitem__)
    assert _first_recording(cells) is log


def test_columns_of_a_log_are_titled_if_one_of_them_has_a_name():
    log = {"t": numbers([0.0, 0.5]), "m": numbers([[1.0, 2.0], [3.0, 4.0]])}
    assert first_rows(tree(log), 9, "/").rows == [["t", "m[:,0]", "m[:,1]"], (0, 1, 2), (0.5, 3, 4)]
    assert first_rows(tree({"m": log["m"]}), 9, "/").rows == [(1, 2), (3, 4)]
    dates = {"t": numbers(np.array([0, 60], "M8[s]")), "x": numbers([1.0, 2.0])}
    assert first_rows(tree(dates), 9, "/").rows == [["t", "x"], (0, 1), (60, 2)]


def test_a_member_among_many_is_found_at_once():
    """Looking up each of 500 names among 60 000 took a minute."""
    names = [f"v{i}" for i in range(60_000)]
    leaf = array_of(lambda _at: np.arange(3.0), (3,))
    group = group_of("the file", names, lambda _name: leaf)
    begun = process_time()
    for name in names[::120]:
        assert group.named(name) is leaf
    (table,) = tables(group, TableRequest("a", tuple(names[:9])))
    assert table.size == 3
    assert process_time() - begun < 2
