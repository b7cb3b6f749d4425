"""Every constant of what drafts take from recordings: levels, held-out data, memory, bad files."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from recorded import recording, write

from mapmore_cli.annexes.drafting import static_or_memory
from mapmore_cli.annexes.drafting.answers import Hold
from mapmore_cli.annexes.drafting.columns import TitledColumn
from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.experiment import (
    Experiment,
    Held,
    find_held,
    goes_in_cycles,
    own_levels,
    set_values,
)
from mapmore_cli.annexes.drafting.held_out import inner, with_split
from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.annexes.drafting.page import draft_page
from mapmore_cli.annexes.drafting.reading import described, split_by, with_words
from mapmore_cli.annexes.drafting.second_log import second_of
from mapmore_cli.annexes.drafting.sources import patterns
from mapmore_cli.annexes.drafting.static_or_memory import with_experiment
from mapmore_cli.annexes.drafting.studies import FolderStudy, find_studies
from mapmore_cli.annexes.drafting.understanding import _is_filtered
from mapmore_cli.checking.evidence import MUCH
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.storage.tables.cells import NotANumber

BARE = Draft({"data": {}})


def experiment(*recordings, inputs=("u",), target="y", held=None, conditions=None, apart=()):
    return Experiment(recordings, inputs, target, held, conditions or {}, apart)


# Levels
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("starts", "levels"),
    [
        # from the 5 % to the 95 % quantile, each recording moves by 0.9; half of this is 0.45
        ([0, 1.4], [0.5, 2]),
        ([0, 1.3], None),
        ([0, 2.8, 4.1], None),
        ([2.8, 0.3, 0], [0.7, 3.3]),  # 0.05 to 1.25 is one level
        ([0, 0], None),
        ([103.6, 211], [104, 211.5]),
    ],
)
def test_levels_are_far_apart_and_rounded_by_their_scatter(starts, levels):
    recordings = [recording(u=start + np.linspace(0, 1, 101)) for start in starts]
    assert own_levels(recordings, "u") == levels


@pytest.mark.parametrize(
    ("low", "high", "levels"),
    [
        ((0, 1), (1.5, 2.5), None),  # the gap is half as wide as a level
        ((0, 1), (1.625, 2.625), [0.5, 2]),
        ((1.5, 3.5), (6, 6), [2, 6]),  # 2 is a quarter of the width from the middle, 2.5
    ],
)
def test_levels_at_the_limits_of_their_distance_and_their_rounding(low, high, levels):
    recordings = [recording(u=np.repeat(ends, 10)) for ends in (low, high)]
    assert own_levels(recordings, "u") == levels


def test_values_that_were_set_are_at_least_three_and_each_has_three_samples():
    assert set_values([recording(u=[3, 1, 2]), recording(u=[1, 2, 3, 1, 2, 3])], "u") == [1, 2, 3]
    assert set_values([recording(u=[1, 2, 3, 1, 2, 3, 1, 2])], "u") == []
    assert set_values([recording(u=[1, 2] * 9)], "u") == []


@pytest.mark.parametrize(
    ("rows", "columns", "said", "conditions", "held"),
    [
        (5, {"t": 0}, None, {}, ("one value in each recording", [1, 2, 4])),
        (5, {"t": 0}, None, {"u": [1, 2, 4]}, ("names", [1, 2, 4])),
        (5, {"t": 0}, Hold("u"), {}, ("you", [1, 2, 4])),
        (4, {"time": 0}, None, {}, ("one value in each recording", [1, 2, 4])),
        (4, {"t": 0}, None, {}, None),  # few samples without a clock
        (4, {"t": 0}, Hold("u"), {}, ("you", [1, 2, 4])),
    ],
)
def test_why_a_quantity_counts_as_held(rows, columns, said, conditions, held):
    recordings = [recording(u=u, v=np.arange(rows) + u / 9, **columns) for u in (1, 2, 4)]
    found = find_held(recordings, ("u", "v"), said, conditions)
    assert (None if found is None else (found.why, found.at)) == held
    assert found is None or (found.of, found.swept, found.within) == ("u", "v", None)


def test_samples_between_levels_of_one_recording_are_left_out():
    strain = np.repeat([0, 0.1, 0.3], 200)
    one = recording(time=np.arange(600), strain=strain, pressure=np.arange(600) % 200)
    held = find_held([one], ("strain", "pressure"), Hold("strain"), {})
    assert (held.at, held.within) == ([0, 0.1, 0.3], 0.01)  # a tenth of the smallest distance
    for said in (None, Hold("none")):
        assert find_held([one], ("strain", "pressure"), said, {}) is None
    with pytest.raises(UsageError, match="no input is called speed"):
        find_held([one], ("strain", "pressure"), Hold("speed"), {})
    table = recording(u=np.repeat([1, 2, 3], 5), v=np.arange(15))
    assert find_held([table], ("u", "v"), None, {}).why == "takes few values"
    level = np.append(np.arange(100), np.arange(100)[::-1])
    both = [recording(u=u, v=level) for u in (1, 2)]
    assert goes_in_cycles(both, find_held(both, ("u", "v"), None, {}))
    for place in (0, 1):
        one_way = [*both]
        one_way[place] = recording(u=place + 1, v=np.arange(200))
        assert not goes_in_cycles(one_way, find_held(one_way, ("u", "v"), None, {}))


# Held-out data
# --------------------------------------------------------------------------------------------------


def test_every_third_inner_level_is_held_out():
    held_out = {2: [], 3: [1], 4: [2], 5: [3], 6: [2], 7: [2, 5], 9: [2, 5], 10: [2, 5, 8]}
    assert {count: inner(range(count)) for count in held_out} == held_out


def logs(count, **columns):
    columns |= {"y": np.arange(30) % 10, "u": np.arange(30) % 7}
    return [recording(f"r{k}", **columns) for k in range(count)]


SET = experiment(*logs(4), conditions={"c": [3, 1, 1, 2]})


@pytest.mark.parametrize(
    ("done", "said", "held_out"),
    [
        (experiment(*logs(2)), None, {"last": 0.3}),
        (experiment(*logs(3)), None, {"recordings": ["r1"]}),
        (experiment(*logs(5)), None, {"recordings": ["r1"]}),
        (experiment(*logs(6)), None, {"recordings": ["r1", "r4"]}),
        (experiment(*logs(2)), "recordings", {"recordings": ["r1"]}),
        (experiment(*logs(3)), "last", {"last": 0.3}),
        (SET, None, {"c": [2]}),
        (SET, "u", {"u": {"between": [[2.0, 3.4]]}}),
        (replace(SET, conditions={"c": [1, 1, 2, 2]}), "c", None),
        (experiment(*logs(3, c=1)), "c", None),  # the band has no width
        (experiment(*logs(1)), "recordings", None),
    ],
)
def test_what_is_held_out(done, said, held_out):
    if held_out is None:
        with pytest.raises(UsageError, match=f"--validate {said}: there are too few"):
            with_split(BARE, done, said)
        return
    draft = with_split(BARE, done, said)
    assert draft.data["split"] == {"validate": held_out}
    assert draft.notes["data", "split"].why.startswith("you; ") == bool(said)


def test_recordings_of_one_file_and_pieces_of_a_log_are_held_out_whole():
    trials = [recording(f"r[{k}]", y=[1, 2], n=k) for k in (9, 3, 5, 4)]
    done = experiment(*trials, apart=["n"])
    assert with_split(BARE, done, None).data["split"] == {"validate": {"n": [4]}}
    many = [recording(f"r[{k}]", y=[1, 2], n=k) for k in range(7)]
    for count, held_out in ((3, [1]), (5, [1]), (6, [1, 4]), (7, [1, 4])):
        some = replace(done, recordings=many[:count])
        assert with_split(BARE, some, None).data["split"] == {"validate": {"n": held_out}}
    two = replace(done, recordings=trials[:2])
    assert with_split(BARE, two, "recordings").data["split"] == {"validate": {"n": [9]}}
    pieces = [recording(f"{log}#{k}", log, y=[1, 2]) for log in "abcd" for k in (1, 2)]
    draft = with_split(BARE, experiment(*pieces), None)
    assert draft.data["split"] == {"validate": {"recordings": ["b#1", "b#2"]}}
    # in the order of the levels 0, 1, 2, 3 instead of the names, held-out recordings lie between
    loads = [recording(f"r{k}", u=[k, k]) for k in (0, 3, 1, 2)]
    draft = with_split(BARE, experiment(*loads, held=Held("u", [], None, "", "")), None)
    assert draft.data["split"] == {"validate": {"recordings": ["r1"]}}
    # a factor or an offset of each session cannot be predicted for a session that is held out
    for key, value in (("groups", {"of": "s", "gain": True}), ("levels", {"of": "u", "at": [1]})):
        draft = with_split(BARE.with_data(key, value), experiment(*logs(4)), None)
        assert draft.data["split"] == {"validate": {"last": 0.3}}


@pytest.mark.parametrize(
    ("course", "held_out"),
    [
        (np.append(np.arange(51), np.arange(49)[::-1]), {"last": 0.3}),
        (np.append(np.arange(70), np.zeros(30)), {"last": 0.3}),  # the lowest value before
        (np.append(np.arange(70), np.full(30, 69)), {"last": 0.3}),  # the highest value before
        (np.append(np.arange(85), np.full(15, 60)), {"last": 0.3}),  # half of the last 30 goes on
        (np.append(np.arange(86), np.full(14, 60)), {"fraction": 0.2, "seed": 1}),
        (np.repeat([0, 1, 2, 3], 25), {"strain": [2]}),  # most of the last 30 have a new value
    ],
)
def test_the_last_samples_are_held_out_unless_most_lie_beyond_the_others(course, held_out):
    done = experiment(recording(strain=course), inputs=("strain",))
    assert with_split(BARE, done, None).data["split"] == {"validate": held_out}
    last = with_split(BARE, done, "last")
    assert last.data["split"] == {"validate": {"last": 0.3}}
    place = "between" if "last" in held_out else "beyond"
    why = f"you; {place}: the last samples of every recording"
    assert last.notes["data", "split"].why.startswith(why)
    parts = [recording(f"r#{k}", "r", strain=part) for k, part in enumerate(np.split(course, 5))]
    whole = with_split(BARE, experiment(*parts, inputs=("strain",)), "last")
    assert whole.notes == last.notes  # the split is that of the whole log


# Static or with memory
# --------------------------------------------------------------------------------------------------


def timed(count, rows, step=0.01, gaps=()):
    time = step * np.arange(rows) + sum(2.0 * (np.arange(rows) > gap) for gap in gaps)
    wave = np.sin(np.arange(rows))
    return experiment(*(recording(f"r{k}", time=time, u=wave, y=wave) for k in range(count)))


def drafted_of(done, draft=BARE):
    return with_experiment(done, draft, "last", lambda _: done.recordings)


@pytest.mark.parametrize(
    ("done", "step"),
    [
        (timed(1, 199), None),
        (timed(2, 100), 0.01),  # the usual step
        (timed(1, 9000, 0.001), 0.0015),  # 6000 samples
        (timed(80, 300, 0.001), 0.003),  # a hundred samples of a recording
    ],
)
def test_two_hundred_samples_with_a_clock_have_memory(done, step):
    draft = drafted_of(done)
    assert draft.data.get("resample") == step
    assert draft.spec["target"] == "y"
    assert ("validate" in draft.spec) == (step is not None)
    assert "gaps" not in draft.data


def test_a_study_with_memory_holds_out_the_end_even_beyond_the_rest():
    done = timed(1, 300)
    rising = [
        replace(one, columns={**one.columns, "u": np.arange(300.0)}) for one in done.recordings
    ]
    done = replace(done, recordings=rising)
    draft = with_experiment(done, BARE, None, lambda _: rising)
    assert draft.data["split"] == {"validate": {"last": 0.3}}


def test_recordings_of_one_sample_do_not_shorten_the_time_step():
    long, single = timed(1, 9000, 0.001), timed(3, 1)
    done = replace(long, recordings=[*long.recordings, *single.recordings])
    assert drafted_of(done).data["resample"] == 0.0015
    assert drafted_of(timed(150, 2)).data["resample"] == 0.01


def test_a_gap_is_longer_than_five_of_the_time_steps_of_the_model():
    assert drafted_of(timed(1, 9000, 0.001, gaps=(9,))).data["gaps"]["longer_than"] == 0.009
    for jump, is_gap in ((5.0, False), (6.0, True)):
        time = np.append(np.arange(150.0), 149 + jump + np.arange(150.0))
        one = recording(time=time, u=np.sin(time), y=np.sin(time))
        assert ("gaps" in drafted_of(experiment(one)).data) == is_gap


def test_gaps_are_longer_than_five_steps_and_are_counted():
    for gaps, why in (((9,), "s: 1 gap; the"), ((9, 50), "s: 2 gaps; the")):
        draft = drafted_of(timed(1, 300, gaps=gaps))
        assert draft.data["gaps"] == {"longer_than": 0.05, "action": "split"}
        assert draft.notes["data", "gaps"].why.startswith(why)
    set_back = BARE.with_data("gaps", {"longer_than": 60.0}, "s: set back")
    draft = drafted_of(timed(1, 300), set_back)
    assert draft.notes["data", "gaps"].why == "s: set back; the memory restarts there"


@pytest.mark.parametrize(
    ("scatter", "is_static"),
    [(4 * [0.9], True), (4 * [1], True), (4 * [1.1], False), ([1.1, 0, 0, 0], False)],
)
def test_recordings_in_which_nothing_moves_are_points(scatter, is_static):
    """The scatter of the target in a recording is at most a tenth of the one between them, 10."""
    swing = np.where(np.arange(100) % 2, 1.0, -1.0)
    points = {k: s + scatter[k] * swing for k, s in enumerate((-10, 10, -10, 10))}
    more = {"time": np.arange(100), "constant": 7}
    recordings = [recording(f"r{k}", u=k, y=y, **more) for k, y in points.items()]
    done = experiment(*recordings, inputs=("u", "constant"))
    assert ("resample" in drafted_of(done).data) != is_static
    for count in (1, 4):  # recordings in which the input moves
        moving = [
            replace(one, columns={**one.columns, "u": 9 * swing}) for one in recordings[:count]
        ]
        assert "resample" in drafted_of(experiment(*moving, *recordings[count:])).data


def swept(levels, **more):
    """Recordings, each at one level, in which the pressure rises and falls."""
    there_and_back = np.append(np.arange(100.0), np.arange(100.0)[::-1])
    columns = {"pressure": there_and_back, "force": there_and_back, **more}
    runs = [recording(f"r{level}", **columns, strain=level) for level in range(levels)]
    held = Held("strain", [float(level) for level in range(levels)], None, "pressure", "you")
    return experiment(*runs, inputs=("strain", "pressure"), target="force", held=held)


@pytest.mark.parametrize(("levels", "has_cycles"), [(2, False), (3, True)])
def test_loops_at_more_than_two_levels_are_split_into_branches(levels, has_cycles):
    assert ("cycles" in drafted_of(swept(levels)).data) == has_cycles


@pytest.mark.parametrize(("share", "is_settled"), [(MUCH, False), (MUCH + 0.01, True)])
def test_only_samples_at_which_the_pressure_has_settled_are_kept(monkeypatch, share, is_settled):
    found = SimpleNamespace(share_between=share, window=0.5, limit=2.0, share=0.4)
    monkeypatch.setattr(static_or_memory, "settling", lambda _: found)
    draft = drafted_of(swept(3, time=np.arange(200.0)))
    keep = [{"quantity": "pressure_rate", "abs_below": 2.0}]
    assert draft.data.get("keep") == (keep if is_settled else None)
    assert ("cycles" in draft.data) != is_settled


@pytest.mark.parametrize(
    ("rows", "names"), [(5, []), (6, ["polynomial_2"]), (7, ["sarosi", "polynomial_2"])]
)
def test_formulas_with_fewer_parameters_than_samples_compete(rows, names):
    one = recording(pressure=np.arange(rows), strain=np.arange(rows), force=np.arange(rows))
    draft = drafted_of(experiment(one, inputs=("pressure", "strain"), target="force"))
    assert draft.spec["target"] == "static"
    assert draft.spec.get("validate", {"against": []})["against"] == names


# Files and columns
# --------------------------------------------------------------------------------------------------


def test_at_most_three_words_mean_a_missing_value():
    def read(cells, rule):
        known = rule["tokens"] if isinstance(rule, dict) else ()
        for cell in cells:
            if cell not in known:
                raise NotANumber(cell, "is no number", "", known=False)
        return "read"

    for cells, known, rule in (
        ("", (), "drop"),
        ("abc", (), {"tokens": ["a", "b", "c"]}),
        ("abcd", ("x",), None),
        ("abc", ("x",), {"tokens": ["x", "a", "b", "c"]}),
    ):
        if rule is None:
            with pytest.raises(NotANumber):
                with_words(lambda rule, cells=cells: read(cells, rule), known)
        else:
            found = with_words(lambda rule, cells=cells: read(cells, rule), known)
            assert found == (rule, "read")


@pytest.mark.parametrize(("count", "more"), [(12, ""), (13, ", ...")])
def test_all_of_five_files_and_twelve_columns_are_described(tmp_path, count, more):
    """The rows are those of the column with the fewest empty cells."""
    titles = [f"c{k}" for k in range(count)]
    for number in range(5):
        rows = ([row, *["" if row < 3 else number + row] * (count - 1)] for row in range(9))
        lines = [",".join(map(str, cells)) for cells in [titles, *rows]]
        (tmp_path / f"{number}.csv").write_text("\n".join([*lines, ""]))
    (study,), _ = find_studies(tmp_path)
    shown = ", ".join(titles[:12])
    told = f"5 files, 45 rows, {count} columns ({shown}{more})"
    assert described(study, tmp_path) == told


def test_a_layout_is_described_by_some_of_its_files(tmp_path):
    columns = {f"c{k}": np.sin(k + np.arange(40.0)) for k in range(13)}
    for number in range(1, 7):
        own = {title: number + x for title, x in columns.items()}
        write(tmp_path / "rig" / f"run{9 + number}_{number**2}bar.csv", own)
    (study,), _ = find_studies(tmp_path)
    shown = ", ".join(f"c{k}" for k in range(12))
    says = "names say pressure 1 4 9 16 25 36 bar"
    told = f"6 files, 120 rows in 3 of them, 13 columns ({shown}, ...); {says}"
    assert described(study, tmp_path) == told
    assert study.name == "rig"
    # digits that all names begin with are not written into the glob
    assert patterns(study.files, tmp_path) == ["rig/run*.csv"]


def test_a_study_is_called_like_its_folder_or_by_words_in_the_names_of_its_files(tmp_path):
    values = np.arange(40.0)
    for number in range(4):
        columns = {"P [kPa]": values + number, "F [N]": values**2}
        write(tmp_path / f"arm 7/left_pull_{number}.csv", columns)
    names = [one.name for one in find_studies(tmp_path)[0]]
    write(tmp_path / "arm 7/left_push_1.csv", {"a": values, "b": values, "c": values})
    write(tmp_path / "arm 7/x.csv", {"d": values, "e": values**2})
    names += [one.name for one in find_studies(tmp_path)[0]]
    assert names == ["arm-7", "left_pull", "left_push_1", "x"]


def test_a_second_log_is_the_only_layout_with_a_pressure_and_as_many_files(tmp_path):
    def study(*titles, files=1, folder="a"):
        paths = tuple(tmp_path / folder / f"{titles}{k}" for k in range(files))
        return FolderStudy(paths, FileLayout("csv", titles, titles, {}, (), ()))

    tester, valve = study("time", "force"), study("time", "pressure")
    assert second_of(tester, [tester, valve]) is valve
    for other in (
        *(study("time", "pressure", files=2), study("time", "pressure", folder="b")),
        *(study("time", "pressure", "strain"), study("time", "temperature"), study("pressure")),
    ):
        assert second_of(tester, [tester, other]) is None
    assert second_of(tester, [tester, valve, study("time", "pressure", "n")]) is None
    assert second_of(valve, [tester, valve]) is second_of(study("force"), [valve]) is None


def test_rows_with_equal_values_of_some_columns_are_a_recording():
    series = {"n": [2.0, 1, 2, 1, 1], "m": [0.0, 0, 0, 0, 5], "y": [1.0, 2, 3, 4, 5]}
    table = {
        title: TitledColumn(title, place, title, [np.array(x)], "", False, "", "")
        for place, (title, x) in enumerate(series.items())
    }
    assert split_by(table, ()) is table
    for said, parts in ((("n",), [[2, 4, 5], [1, 3]]), (("0", "m"), [[2, 4], [5], [1, 3]])):
        assert [x.tolist() for x in split_by(table, said)["y"].values] == parts
    short = {**table, "y": replace(table["y"], values=[np.zeros(4)])}
    assert [*map(len, split_by(short, ("n",))["y"].values)] == [4]
    assert split_by(short, ("n", "y")) is short


def test_a_target_was_computed_from_three_samples_of_a_column():
    x = np.random.default_rng(1).normal(size=60)
    y = np.convolve(x, [0.5, 0.3, 0.2], mode="full")[:60] + 7
    wrong = y + 5e-4 * np.ptp(y) * (np.arange(60) == 30)
    older = np.append(np.zeros(3), x[:-3])
    assert _is_filtered([x], [y])
    assert not _is_filtered([x], [wrong])
    assert not _is_filtered([x], [older])
    assert _is_filtered([x, x], [y, y])
    assert _is_filtered([x[:30]], [y[:30]])
    assert not _is_filtered([x[:29]], [y[:29]])
    assert not _is_filtered([x], [y[:-1]])
    assert not _is_filtered([x, x], [y, y[:-1]])


def test_the_page_of_a_draft_shows_each_column_and_inputs_against_the_output():
    columns = {"time": {"column": "t"}, "u": {"column": "U"}, "y": {"column": "Y"}}
    spec = {"name": "a", "target": "y", "data": {"columns": columns, "files": ["x.csv"]}}
    raw = {title: [np.arange(4.0)] for title in ("t", "U", "Y", "other")}
    page = draft_page(Draft(spec, files=2, raw=raw | {"z": [np.arange(3.0)]}))
    assert page.count("<svg") == 5 + 1
    assert page.count("left out") == 2
    assert "u across, y up" in page
    assert "1 of them are drawn" in page
