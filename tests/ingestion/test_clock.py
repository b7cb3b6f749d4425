"""Gaps, resets and missing samples are found, reported by file and row, and mended only as the spec
says; second logs are joined.
"""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from ingest_samples import COLUMNS, csv_text
from reading import refused

from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion import clock
from mapmore_cli.ingestion.clock import MOST_SAMPLES, _resampled, going_on, without_glitches
from mapmore_cli.ingestion.samples import Samples

SPLIT = {"longer_than": 0.15, "action": "split"}


def logged(*stamps, **columns):
    t = np.array(stamps, dtype=float)
    return csv_text(**{"t": t, "P": 80, "eps": t, "F": 10 * t, **columns})


def test_gaps_split_a_recording_into_numbered_pieces(ingest):
    dataset = ingest({"a.csv": logged(0, 0.1, 0.2, 1, 1.1, 3, 3.1, 3.2)}, gaps=SPLIT)
    assert [(c.id, c.recordings, list(c.columns["time"])) for c in dataset.curves] == [
        ("a#1", ("a#1",), [0, 0.1, 0.2]),
        ("a#2", ("a#2",), [1, 1.1]),
        ("a#3", ("a#3",), [3, 3.1, 3.2]),
    ]
    (note,) = dataset.notes
    assert note.startswith(
        "a.csv:row 4: the first of 2 gaps longer than 0.15 s follows; the longest lasts 1.9 "
        "s, after row 6; "
    )
    assert note.endswith("about 25 samples are missing: split")
    assert [one.log for one in dataset.recordings] == ["a"] * 3
    (whole,) = ingest({"a.csv": logged(0, 0.1, 0.2)}, gaps=SPLIT).recordings
    assert (whole.id, whole.log) == ("a", "")


@pytest.mark.parametrize(
    ("unit", "turn", "told"), [("s", 60, 60), ("ms", 60_000, 60), ("ms", 1000, 1)]
)
def test_a_column_of_seconds_or_of_milliseconds_goes_on_by_unwrap(ingest, unit, turn, told):
    stamps = [turn / 60 * (i % 60) for i in range(100)]
    clock = {"time": {"column": "t", "unit": unit}}
    parts = "a.csv:row 62: time runs backwards", f"restarts at {told} s, write `unwrap: {told}`"
    with refused(*parts):
        ingest({"a.csv": logged(*stamps)}, columns={**COLUMNS, **clock})
    clock["time"]["unwrap"] = turn
    made = ingest({"a.csv": logged(*stamps)}, columns={**COLUMNS, **clock})
    np.testing.assert_allclose(made.recordings[0].columns["time"], told / 60 * np.arange(100.0))


@pytest.mark.parametrize(
    ("before", "after", "is_restart"),
    [(3600, 0, True), (3601, 0, False), (3500, 260, True), (3500, 261, False)],
)
def test_a_clock_restarts_by_nine_tenths_of_its_turn_from_the_turn_at_most(
    before, after, is_restart
):
    found = going_on(np.array([10.0, before, after, after + 1]), [3600.0])
    assert found.tolist() == ([0, 0, 3600, 3600] if is_restart else [0, 0, 0, 0])


def test_gaps_are_an_error_where_the_spec_says_so_and_a_warning_where_it_says_nothing(
    ingest,
):
    text = logged(*np.arange(20) * 0.1, 5.0, *(5.1 + np.arange(20) * 0.1))
    told = "a.csv:row 21: a gap longer than 0.5 s follows; the longest lasts 3.1 s"
    with refused(told, "action: split"):
        ingest({"a.csv": text}, gaps={"longer_than": 0.5})
    warnings = []
    dataset = ingest({"a.csv": text}, warnings=warnings)
    assert [c.id for c in dataset.curves] == ["a"]
    assert len(warnings) == 1
    assert warnings[0].startswith("a.csv:row 21: a gap longer than 1 s follows")
    assert "about 30 samples are missing" in warnings[0]


def test_clock_that_is_set_back_splits_where_gaps_do(ingest):
    text = logged(0, 0.1, 0.2, 0.05, 0.15, 1.0, 1.1)
    with refused("a.csv:row 5: time runs backwards, from 0.2 to 0.05", "action: split"):
        ingest({"a.csv": text})
    dataset = ingest({"a.csv": text}, gaps=SPLIT)
    assert [list(c.columns["time"]) for c in dataset.curves] == [
        [0, 0.1, 0.2],
        [0.05, 0.15],
        [1.0, 1.1],
    ]
    assert [c.id for c in dataset.curves] == ["a#1", "a#2", "a#3"]
    assert (
        dataset.notes[0]
        == "a.csv:row 5: the clock was set back, from 0.2 to 0.05 s; the recording is split there"
    )


def test_dropped_samples_count_for_their_piece(ingest):
    force = [0, np.nan, 2, 3, np.nan, np.nan, 99, 7]
    text = logged(0, 0.1, 0.12, 1, 1.1, 1.12, 1.2, 1.3, F=force)
    dataset = ingest(
        {"a.csv": text}, gaps=SPLIT, missing="drop", keep=[{"quantity": "force", "below": 50.0}]
    )
    assert [(r.id, r.rows_read, dict(r.dropped)) for r in dataset.recordings] == [
        ("a#1", 3, {"missing value": 1}),
        ("a#2", 3, {"missing value": 2}),  # which leave a gap
        ("a#3", 2, {"force >= 50 N": 1}),
    ]


def test_pieces_without_samples_are_left_out_with_a_warning(ingest):
    warnings = []
    dataset = ingest(
        {"a.csv": logged(0, 0.1, 1, 1.1, 2, 2.1)},
        gaps=SPLIT,
        keep=[{"quantity": "force", "above": 5.0}],
        warnings=warnings,
    )
    assert [(c.id, c.size) for c in dataset.curves] == [("a#1", 2), ("a#2", 2)]
    assert warnings[0] == (
        "a.csv: 1 of 3 pieces between gaps (`data.gaps`) have no sample left; check `keep` and "
        "`gaps`"
    )
    with pytest.raises(DataError, match="no sample is left"):
        ingest(
            {"a.csv": logged(0, 0.1, 1, 1.1)},
            gaps=SPLIT,
            keep=[{"quantity": "force", "above": 99.0}],
        )


def test_last_counts_over_all_pieces_of_a_log(ingest):
    pieces = [k + np.arange(10) * 0.1 for k in (0, 10, 20, 30)]
    dataset = ingest(
        {"a.csv": logged(*np.concatenate(pieces))}, gaps=SPLIT, split={"validate": {"last": 0.375}}
    )
    assert [int(c.held_out.sum()) for c in dataset.curves] == [0, 0, 5, 10]


def test_resampling_goes_piece_by_piece_before_rates_are_taken(ingest):
    t = np.concatenate([np.arange(1000), 3000 + np.arange(505)]) * 0.001
    text = csv_text(t=t, P=100 * t, eps=np.sin(200 * np.pi * t), F=0)
    derive = {"pressure_rate": {"rate_of": "pressure", "window": 0.05, "order": 1}}
    dataset = ingest({"a.csv": text}, gaps=SPLIT, resample=0.01, derive=derive)
    assert [c.size for c in dataset.curves] == [100, 50]
    for curve, start in zip(dataset.curves, (0, 3), strict=True):
        np.testing.assert_allclose(
            curve.columns["time"], start + 0.0045 + 0.01 * np.arange(curve.size), atol=1e-9
        )
        np.testing.assert_allclose(
            curve.columns["pressure"], 100 * curve.columns["time"], rtol=1e-6
        )
        np.testing.assert_allclose(curve.columns["strain"], 0, atol=1e-6)
        np.testing.assert_allclose(curve.columns["pressure_rate"], 100, rtol=1e-4)
    assert [r.rows_read for r in dataset.recordings] == [1000, 505]


def test_a_sample_on_even_steps_has_the_row_of_the_one_that_it_follows(monkeypatch):
    """A stamp right at a sample is that sample's."""
    columns = {"time": np.array([0.0, 1.0, 2.0]), "force": np.array([0.0, 2.0, 6.0])}
    samples = Samples(columns, np.array([7, 8, 12]), "a.csv")
    found = _resampled(samples, 0.5)
    assert found.rows.tolist() == [7, 7, 8, 8, 12]
    assert found.columns["force"].tolist() == [0, 1, 2, 4, 6]
    assert (found.size, found.merged) == (5, -2)
    samples = replace(samples, columns={**columns, "time": np.array([0.0, 4.0, 1e9])})
    with refused(
        "a.csv: `resample` would make 1e+09 samples from 3", "a step of 3.33e+08 would keep"
    ):
        _resampled(samples, 1.0)
    assert MOST_SAMPLES == 10_000_000
    monkeypatch.setattr(clock, "MOST_SAMPLES", 4)
    for most, step, size in ((1, 0.5, 5), (1, 0.4, None), (2, 0.4, 6), (2, 0.3, None)):
        monkeypatch.setattr(clock, "MOST_TIMES", most)
        with nullcontext() if size else refused("`resample` would make"):
            assert _resampled(replace(samples, columns=columns), step).size == size
    few = _resampled(replace(samples, columns=columns), 5.0)
    assert (few.size, next(iter(few.left_out.values())).tolist()) == (0, [7, 8, 12])


@pytest.mark.parametrize(("wrong", "left"), [([50], 99), ([50, 70], 100)])
def test_glitches_are_one_sample_in_a_hundred_at_most(wrong, left):
    time = np.arange(100.0)
    time[wrong] = 1.5
    samples = Samples({"time": time}, np.arange(100), "a.csv")
    assert without_glitches(samples, "drop").size == left
    assert without_glitches(samples, "keep").size == 100


def test_piece_shorter_than_a_step_is_left_out(ingest):
    warnings = []
    text = logged(*np.arange(50) * 0.01, 7, 7.01, *(9 + np.arange(50) * 0.01))
    dataset = ingest({"a.csv": text}, gaps=SPLIT, resample=0.1, warnings=warnings)
    assert [c.size for c in dataset.curves] == [5, 5]
    assert "1 of 3 pieces" in warnings[0]


def test_sample_time_stands_for_a_time_column(ingest):
    columns = {name: column for name, column in COLUMNS.items() if name != "time"}
    text = csv_text(t=7, P=80, eps=0, F=[1, 2, np.nan, 4])
    got = ingest({"a.csv": text}, columns=columns, sample_time=0.01, missing="drop").recordings[0]
    np.testing.assert_allclose(got.columns["time"], [0, 0.01, 0.03])


# Second logs
# --------------------------------------------------------------------------------------------------

FIRST = {name: column for name, column in COLUMNS.items() if name != "pressure"}
SECOND = {"time": {"column": "ms", "unit": "ms"}, "pressure": {"column": "p", "unit": "bar"}}
BY_ROW = {
    "columns": {"pressure": {"column": 0, "unit": "kPa"}},
    "on": "row",
    "header": False,
}
T = np.arange(11) * 0.1


TESTER = csv_text(t=T, eps=0, F=T)
MATCH = {"first": "pressure", "second": "pressure_2"}


def joining(
    ingest,
    second,
    first="",
    join=None,
    **data,
):
    firsts = first if isinstance(first, dict) else {"first.csv": first or TESTER}
    seconds = second if isinstance(second, dict) else {"second.txt": second}
    entry = {"files": ["second*.txt"], "columns": SECOND, **(join or {})}
    return ingest({**firsts, **seconds}, files=["first*.csv"], columns=FIRST, join=[entry], **data)


def test_second_log_is_shifted_converted_and_interpolated(ingest):
    second = csv_text(ms=5000 + 30 * np.arange(40), p=np.arange(40) * 0.03)
    got = joining(ingest, second, join={"shift": -5.0}).recordings[0]
    np.testing.assert_allclose(got.columns["pressure"], 100 * T, atol=1e-9)
    np.testing.assert_allclose(got.columns["time"], T)
    assert (got.rows_read, dict(got.dropped)) == (11, {})


def test_samples_outside_and_in_gaps_are_dropped_and_counted(ingest):
    stamps = [200, 300, 400, 700, 800]
    got = joining(
        ingest, csv_text(ms=stamps, p=1), join={"max_gap": 0.15}, missing="drop"
    ).recordings[0]
    np.testing.assert_allclose(got.columns["time"], [0.2, 0.3, 0.4, 0.7, 0.8])
    assert (got.rows_read, dict(got.dropped)) == (11, {"missing value": 6})
    whole = joining(ingest, csv_text(ms=stamps, p=1), missing="drop").recordings[0]
    np.testing.assert_allclose(whole.columns["time"], T[2:9])


def test_missing_values_of_either_log(ingest):
    first = csv_text(t=[0, np.nan, 0.2, 0.3], eps=0, F=[0, 1, np.nan, 3])
    second = csv_text(ms=[0, 100, 200, 300], p=[0, np.nan, 2, 3])
    got = joining(ingest, second, first, missing="drop").recordings[0]
    np.testing.assert_allclose(got.columns["pressure"], [0, 300])
    assert dict(got.dropped) == {"missing value": 2}


def test_by_row(ingest):
    got = joining(ingest, "\n".join(map(str, range(11))), join=BY_ROW).recordings[0]
    np.testing.assert_array_equal(got.columns["pressure"], np.arange(11))


def test_several_logs_are_paired_in_order_and_one_serves_all(ingest):
    firsts = {"first_a.csv": TESTER, "first_b.csv": TESTER}
    seconds = {
        f"second_{name}.txt": csv_text(ms=[0, 1000], p=value)
        for name, value in (("1", 1), ("2", 2))
    }
    both = joining(ingest, seconds, firsts).recordings
    assert [recording.columns["pressure"][0] for recording in both] == [100, 200]
    one = joining(ingest, {}, firsts, join={"files": ["second_2.txt"]}).recordings
    assert [recording.columns["pressure"][0] for recording in one] == [200, 200]


def test_third_log(ingest):
    more = {"files": ["third.txt"], "columns": {"load": {"column": "m"}, "time": {"column": "t"}}}
    files = {
        "first.csv": TESTER,
        "second.txt": csv_text(ms=[0, 1000], p=1),
        "third.txt": csv_text(t=[0, 1], m=[5, 15]),
    }
    got = ingest(
        files,
        files=["first.csv"],
        columns=FIRST,
        join=[{"files": ["second.txt"], "columns": SECOND}, more],
    )
    np.testing.assert_allclose(got.recordings[0].columns["load"], 5 + 10 * T)


BROKEN = {
    "too short": (csv_text(ms=[0, 850], p=1), {},
        ["first.csv:row 11: the value of pressure is missing", "2 of 11"]),
    "another day": (csv_text(ms=[9e6, 9.1e6], p=1), {},
        ["second.txt: has no sample at the times of first.csv", "9000 to 9100 s"]),
    "missing": (csv_text(ms=[0, 1000], p=[1, np.nan]), {},
        ["second.txt:row 3, column p: the value of pressure is missing"]),
    "backwards": (csv_text(ms=[0, 900, 800], p=1), {}, ["second.txt:row 4: time runs backwards"]),
    "repeated": (csv_text(ms=[0, 0, 1000], p=1), {}, ["second.txt:row 3: the time 0 occurs twice"]),
    "rows": ("0\n1\n", BY_ROW, ["second.txt: has 2 rows", "first.csv has 11"]),
    "no file": ({}, {}, ["second*.txt: no such file"]),
    "pairs": ({f"second_{i}.txt": csv_text(ms=[0], p=1) for i in (1, 2)}, {},
        ["join: 2 files cannot be paired with 1", "second_1.txt"]),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_logs_that_do_not_fit(ingest, case):
    second, join, parts = BROKEN[case]
    with refused(*parts):
        joining(ingest, second, join=join)


def test_repeated_stamps_of_the_second_log_are_mended_as_the_spec_says(ingest):
    got = joining(
        ingest, csv_text(ms=[0, 1000, 1000], p=[0, 1, 3]), repeated_time="average"
    ).recordings[0]
    np.testing.assert_allclose(got.columns["pressure"], 200 * T, atol=1e-9)


@pytest.mark.parametrize("tick", [0.1, 0.5])
def test_the_shift_is_found_and_told(ingest, tick):
    """Two logs of one pressure, the second in ms on a clock that is 7.5 s ahead of the first, which
    has a stamp for every tick: of samples with one stamp, the first is at its time.
    """
    values = np.random.default_rng(4).uniform(0, 300, 40)
    t = np.arange(0, 40, 0.1)
    wave, later = (np.interp(t - ahead, np.arange(-20, 60, 2), values) for ahead in (0, 7.5))
    columns = {"time": {"column": "ms", "unit": "ms"}, "pressure_2": {"column": "p", "unit": "bar"}}
    entry = {"files": ["second.txt"], "columns": columns, "shift": "auto", "match": MATCH}
    got = ingest(
        {
            "first.csv": csv_text(t=tick * np.floor(t / tick + 1e-9), P=wave, eps=0 * t, F=t),
            "second.txt": csv_text(ms=1000 * t, p=later / 100, F=t),
        },
        files=["first.csv"],
        join=[entry],
        missing="drop",
        units={"pressure_2": "kPa"},
        repeated_time="average",
    )
    (note,) = (note for note in got.notes if "shift" in note)
    assert note.startswith("second.txt: shift -7.5")
    if tick > 0.1:
        return
    assert "correlation" in note
    columns = got.recordings[0].columns
    np.testing.assert_allclose(columns["pressure_2"], columns["pressure"], atol=2.0)


def test_a_time_step_that_would_fill_the_memory_is_refused(ingest):
    """A hundred times the samples are not yet too many where they are few."""
    text = csv_text(t=np.arange(4.0), P=80, eps=0, F=[1, 2, 3, 4])
    (curve,) = ingest({"a.csv": text}, resample=0.005).curves
    assert curve.size == 601
    with refused(
        "would make 3e+07 samples from 4", "a longer time step; a step of 0.75 would keep"
    ):
        ingest({"a.csv": text}, resample=1e-7)


WITHOUT_TIME = {name: column for name, column in COLUMNS.items() if name != "time"}
MINUTES = {**COLUMNS, "time": {"column": "t", "unit": "min"}}
AT_REST = {**COLUMNS, "force": {"column": "F", "unit": "N", "rest": 0.15}}
WEIGHED = {"time": SECOND["time"], "load": {"column": "p"}}
SHIFTED = {"shift": 0.25, "max_gap": 0.15}
TIMES = {
    "gaps": {"columns": MINUTES, "gaps": {"longer_than": 61.0, "action": "split"}},
    "resampled": {"resample": 0.05},
    "sample times": {"columns": WITHOUT_TIME, "sample_time": 0.1, "every": 2},
    "rest": {"columns": AT_REST},
    "second log": {
        "join": [{"files": ["b.txt"], "columns": WEIGHED, **SHIFTED}],
        "missing": "drop",
    },
}


@pytest.mark.parametrize("case", TIMES)
def test_times_of_a_spec_are_seconds_whatever_the_unit_of_the_model(ingest, case):
    files = {
        "a.csv": logged(0, 0.1, 0.2, 0.3, 2.4, 2.5),
        "b.txt": csv_text(ms=[0, 100, 400, 2200], p=[1, 2, 3, 4]),
    }

    def of(unit):
        made = ingest(files, **{"files": ["a.csv"], **TIMES[case]}, units={"time": unit})
        return [dict(curve.columns) for curve in made.curves]

    seconds = of("s")
    for unit, factor in (("ms", 1e3), ("min", 1 / 60)):
        for plain, other in zip(seconds, of(unit), strict=True):
            assert other.pop("time") == pytest.approx(factor * plain["time"], abs=1e-12)
            for name, values in other.items():
                np.testing.assert_allclose(values, plain[name], atol=1e-9)
