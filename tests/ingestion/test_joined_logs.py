from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from ingest_samples import COLUMNS, Ingest, csv_text

from mapmore_cli.domain.errors import DataError, MapmoreError

FIRST = {name: column for name, column in COLUMNS.items() if name != "pressure"}
SECOND = {"time": {"column": "ms", "unit": "ms"}, "pressure": {"column": "p", "unit": "bar"}}
T = np.arange(11) * 0.1


TESTER = csv_text(t=T, eps=0, F=T)


def joining(ingest: Ingest, second: str | dict[str, str], first: str | dict[str, str] = "", join: Any = None, **data: Any) -> Any:
    firsts = first if isinstance(first, dict) else {"first.csv": first or TESTER}
    seconds = second if isinstance(second, dict) else {"second.txt": second}
    entry = {"files": ["second*.txt"], "columns": SECOND, **(join or {})}
    return ingest({**firsts, **seconds}, files=["first*.csv"], columns=FIRST, join=[entry], **data)


def test_second_log_is_shifted_converted_and_interpolated(ingest: Ingest) -> None:
    second = csv_text(ms=5000 + 30 * np.arange(40), p=np.arange(40) * 0.03)
    got = joining(ingest, second, join={"shift": -5.0}).recordings[0]
    np.testing.assert_allclose(got.columns["pressure"], 100 * T, atol=1e-9)
    np.testing.assert_allclose(got.columns["time"], T)
    assert (got.rows_read, dict(got.dropped)) == (11, {})


def test_samples_outside_and_in_gaps_are_dropped_and_counted(ingest: Ingest) -> None:
    stamps = [200, 300, 400, 700, 800]
    got = joining(ingest, csv_text(ms=stamps, p=1), join={"max_gap": 0.15}, missing="drop").recordings[0]
    np.testing.assert_allclose(got.columns["time"], [0.2, 0.3, 0.4, 0.7, 0.8])
    assert (got.rows_read, dict(got.dropped)) == (11, {"missing value": 6})
    whole = joining(ingest, csv_text(ms=stamps, p=1), missing="drop").recordings[0]
    np.testing.assert_allclose(whole.columns["time"], T[2:9])


def test_missing_values_of_either_log(ingest: Ingest) -> None:
    first = csv_text(t=[0, np.nan, 0.2, 0.3], eps=0, F=[0, 1, np.nan, 3])
    second = csv_text(ms=[0, 100, 200, 300], p=[0, np.nan, 2, 3])
    got = joining(ingest, second, first, missing="drop").recordings[0]
    np.testing.assert_allclose(got.columns["pressure"], [0, 300])
    assert dict(got.dropped) == {"missing value": 2}


def test_by_row(ingest: Ingest) -> None:
    columns = {"pressure": {"column": 0, "unit": "kPa"}}
    text = "\n".join(str(p) for p in range(11))
    got = joining(ingest, text, join={"columns": columns, "on": "row", "header": False}).recordings[0]
    np.testing.assert_array_equal(got.columns["pressure"], np.arange(11))


def test_several_logs_are_paired_in_order_and_one_serves_all(ingest: Ingest) -> None:
    firsts = {"first_a.csv": TESTER, "first_b.csv": TESTER}
    seconds = {f"second_{name}.txt": csv_text(ms=[0, 1000], p=value) for name, value in (("1", 1), ("2", 2))}
    both = joining(ingest, seconds, firsts).recordings
    assert [recording.columns["pressure"][0] for recording in both] == [100, 200]
    one = joining(ingest, {}, firsts, join={"files": ["second_2.txt"]}).recordings
    assert [recording.columns["pressure"][0] for recording in one] == [200, 200]


def test_third_log(ingest: Ingest) -> None:
    more = {"files": ["third.txt"], "columns": {"load": {"column": "m"}, "time": {"column": "t"}}}
    files = {"first.csv": TESTER, "second.txt": csv_text(ms=[0, 1000], p=1), "third.txt": csv_text(t=[0, 1], m=[5, 15])}
    got = ingest(files, files=["first.csv"], columns=FIRST, join=[{"files": ["second.txt"], "columns": SECOND}, more])
    np.testing.assert_allclose(got.recordings[0].columns["load"], 5 + 10 * T)


BY_ROW: dict[str, Any] = {"columns": {"pressure": {"column": 0, "unit": "kPa"}}, "on": "row", "header": False}

BROKEN: dict[str, tuple[str | dict[str, str], dict[str, Any], list[str]]] = {
    "too short": (csv_text(ms=[0, 850], p=1), {}, ["first.csv:row 11: the value of pressure is missing", "2 of 11"]),
    "another day": (csv_text(ms=[9e6, 9.1e6], p=1), {}, ["second.txt: no sample at the time of first.csv", "9000 to 9100 s"]),
    "missing": (csv_text(ms=[0, 1000], p=[1, np.nan]), {}, ["second.txt:row 3, column p: the value of pressure is missing"]),
    "backwards": (csv_text(ms=[0, 900, 800], p=1), {}, ["second.txt:row 4: time runs backwards"]),
    "repeated": (csv_text(ms=[0, 0, 1000], p=1), {}, ["second.txt:row 3: the time 0 stands twice"]),
    "rows": ("0\n1\n", BY_ROW, ["second.txt: has 2 rows", "first.csv has 11"]),
    "no file": ({}, {}, ["second*.txt: no such file"]),
    "pairs": ({f"second_{i}.txt": csv_text(ms=[0], p=1) for i in (1, 2)}, {}, ["join: 2 files cannot be paired with 1", "second_1.txt"]),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_logs_that_do_not_fit(ingest: Ingest, case: str) -> None:
    second, join, parts = BROKEN[case]
    with pytest.raises(MapmoreError) as caught:
        joining(ingest, second, join=join)
    assert isinstance(caught.value, DataError)
    assert all(part in str(caught.value) for part in parts), str(caught.value)


def test_repeated_stamps_of_the_second_log_are_mended_as_the_spec_says(ingest: Ingest) -> None:
    got = joining(ingest, csv_text(ms=[0, 1000, 1000], p=[0, 1, 3]), repeated_time="average").recordings[0]
    np.testing.assert_allclose(got.columns["pressure"], 200 * T, atol=1e-9)


def on_other_clocks(ingest: Ingest, wave: Any, match: dict[str, Any]) -> Any:
    """Two logs of one pressure, the second in ms on a clock that is 7.5 s ahead of the first."""
    t = np.arange(0, 40, 0.1)
    first = csv_text(t=t, P=wave(t), eps=0 * t, F=t)
    second = csv_text(ms=1000 * t, p=wave(t - 7.5) / 100, F=t)
    columns = {"time": {"column": "ms", "unit": "ms"}, "pressure_2": {"column": "p", "unit": "bar"}}
    entry = {"files": ["second*.txt"], "columns": columns, "shift": "auto", "match": match}
    units = {"pressure_2": "kPa"}
    files = {"first.csv": first, "second.txt": second}
    return ingest(files, files=["first*.csv"], columns=COLUMNS, join=[entry], missing="drop", units=units)


def test_the_shift_is_found_and_told(ingest: Ingest) -> None:
    values = np.random.default_rng(4).uniform(0, 300, 40)
    got = on_other_clocks(ingest, lambda t: np.interp(t, np.arange(-20, 60, 2), values), {"first": "pressure", "second": "pressure_2"})
    (note,) = (note for note in got.notes if "shift" in note)
    assert note.startswith("second.txt: shift -7.5")
    assert "correlation" in note
    columns = got.recordings[0].columns
    np.testing.assert_allclose(columns["pressure_2"], columns["pressure"], atol=2.0)


def test_an_ambiguous_shift_is_refused_and_a_guess_helps(ingest: Ingest) -> None:
    def wave(t):
        return 100 + 50 * np.sin(2 * np.pi * t / 20)

    with pytest.raises(DataError, match="ambiguous") as fault:
        on_other_clocks(ingest, lambda t: wave(5 * t), {"first": "pressure", "second": "pressure_2"})
    assert "within:" in fault.value.remedy
    assert fault.value.exit_code == 4
    got = on_other_clocks(ingest, wave, {"first": "pressure", "second": "pressure_2", "within": 9.0})
    assert any("shift -7.5" in note for note in got.notes)


def test_a_shift_that_nothing_tells_is_refused(ingest: Ingest) -> None:
    with pytest.raises(DataError, match="nothing changes"):
        on_other_clocks(ingest, lambda t: 0 * t + 100, {"first": "pressure", "second": "pressure_2"})
