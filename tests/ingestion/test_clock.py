"""Gaps, resets and missing samples are found, reported by file and row, and mended only as the spec says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ingest_samples import COLUMNS, Ingest, csv_text

from mapmore_cli.domain.errors import DataError

SPLIT = {"longer_than": 0.15, "action": "split"}


def logged(*stamps: float, **columns: object) -> str:
    t = np.array(stamps, dtype=float)
    return csv_text(**{"t": t, "P": 80, "eps": t, "F": 10 * t, **columns})


def test_gaps_split_a_recording_into_numbered_pieces(ingest: Ingest) -> None:
    dataset = ingest({"a.csv": logged(0, 0.1, 0.2, 1, 1.1, 3, 3.1, 3.2)}, gaps=SPLIT)
    assert [(c.id, c.recordings, list(c.columns["time"])) for c in dataset.curves] == [
        ("a#1", ("a#1",), [0, 0.1, 0.2]),
        ("a#2", ("a#2",), [1, 1.1]),
        ("a#3", ("a#3",), [3, 3.1, 3.2]),
    ]
    (note,) = dataset.notes
    assert note.startswith("a.csv:row 4: the first of 2 gaps longer than 0.15 s follows; the longest takes 1.9 s, after row 6; ")
    assert note.endswith("about 25 samples are missing: split")


def test_recording_without_gaps_keeps_its_name(ingest: Ingest) -> None:
    assert [c.id for c in ingest({"a.csv": logged(0, 0.1, 0.2)}, gaps=SPLIT).curves] == ["a"]


def test_gaps_are_an_error_where_the_spec_says_so_and_a_warning_where_it_says_nothing(ingest: Ingest) -> None:
    text = logged(*np.arange(20) * 0.1, 5.0, *(5.1 + np.arange(20) * 0.1))
    with pytest.raises(DataError, match=r"a\.csv:row 21: a gap longer than 0\.5 s follows; the longest takes 3\.1 s") as caught:
        ingest({"a.csv": text}, gaps={"longer_than": 0.5})
    assert "action: split" in str(caught.value)
    warnings: list[str] = []
    dataset = ingest({"a.csv": text}, warnings=warnings)
    assert [c.id for c in dataset.curves] == ["a"]
    assert len(warnings) == 1
    assert warnings[0].startswith("a.csv:row 21: a gap longer than 1 s follows")
    assert "about 30 samples are missing" in warnings[0]


def test_units_of_gaps_do_not_hang_on_the_model(ingest: Ingest) -> None:
    columns = {**COLUMNS, "time": {"column": "t", "unit": "min"}}
    for unit in ("s", "ms"):
        dataset = ingest(
            {"a.csv": logged(0, 1, 2, 5, 6)}, columns=columns, gaps={"longer_than": 61.0, "action": "split"}, units={"time": unit}
        )
        assert [c.size for c in dataset.curves] == [3, 2]


def test_clock_that_is_set_back_splits_where_gaps_do(ingest: Ingest) -> None:
    text = logged(0, 0.1, 0.2, 0.05, 0.15, 1.0, 1.1)
    with pytest.raises(DataError, match=r"a\.csv:row 5: time runs backwards, from 0\.2 to 0\.05") as caught:
        ingest({"a.csv": text})
    assert "action: split" in str(caught.value)
    dataset = ingest({"a.csv": text}, gaps=SPLIT)
    assert [list(c.columns["time"]) for c in dataset.curves] == [[0, 0.1, 0.2], [0.05, 0.15], [1.0, 1.1]]
    assert [c.id for c in dataset.curves] == ["a#1", "a#2", "a#3"]
    assert dataset.notes[0] == "a.csv:row 5: the clock was set back, from 0.2 to 0.05 s: split"


def test_dropped_samples_count_for_their_piece(ingest: Ingest) -> None:
    force = [0, np.nan, 2, 3, np.nan, np.nan, 99, 7]
    text = logged(0, 0.1, 0.12, 1, 1.1, 1.12, 1.2, 1.3, F=force)
    dataset = ingest({"a.csv": text}, gaps=SPLIT, missing="drop", keep=[{"quantity": "force", "below": 50.0}])
    assert [(r.id, r.rows_read, dict(r.dropped)) for r in dataset.recordings] == [
        ("a#1", 3, {"missing value": 1}),
        ("a#2", 3, {"missing value": 2}),  # which leave a gap
        ("a#3", 2, {"force >= 50 N": 1}),
    ]


def test_pieces_without_samples_are_left_out_with_a_warning(ingest: Ingest) -> None:
    warnings: list[str] = []
    dataset = ingest({"a.csv": logged(0, 0.1, 1, 1.1, 2, 2.1)}, gaps=SPLIT, keep=[{"quantity": "force", "above": 5.0}], warnings=warnings)
    assert [(c.id, c.size) for c in dataset.curves] == [("a#1", 2), ("a#2", 2)]
    assert warnings[0] == "a.csv: 1 of 3 pieces between gaps have no sample left"
    with pytest.raises(DataError, match="no sample is left"):
        ingest({"a.csv": logged(0, 0.1, 1, 1.1)}, gaps=SPLIT, keep=[{"quantity": "force", "above": 99.0}])


def test_last_counts_over_all_pieces_of_a_log(ingest: Ingest) -> None:
    pieces = [k + np.arange(10) * 0.1 for k in (0, 10, 20, 30)]
    dataset = ingest({"a.csv": logged(*np.concatenate(pieces))}, gaps=SPLIT, split={"validate": {"last": 0.375}})
    assert [int(c.held_out.sum()) for c in dataset.curves] == [0, 0, 5, 10]


def test_resampling_goes_piece_by_piece_before_rates_are_taken(ingest: Ingest) -> None:
    t = np.concatenate([np.arange(1000), 3000 + np.arange(505)]) * 0.001
    text = csv_text(t=t, P=100 * t, eps=np.sin(200 * np.pi * t), F=0)
    derive = {"pressure_rate": {"rate_of": "pressure", "window": 0.05, "order": 1}}
    dataset = ingest({"a.csv": text}, gaps=SPLIT, resample=0.01, derive=derive)
    assert [c.size for c in dataset.curves] == [100, 50]
    for curve, start in zip(dataset.curves, (0, 3), strict=True):
        np.testing.assert_allclose(curve.columns["time"], start + 0.0045 + 0.01 * np.arange(curve.size), atol=1e-9)
        np.testing.assert_allclose(curve.columns["pressure"], 100 * curve.columns["time"], rtol=1e-6)
        np.testing.assert_allclose(curve.columns["strain"], 0, atol=1e-6)
        np.testing.assert_allclose(curve.columns["pressure_rate"], 100, rtol=1e-4)
    assert [r.rows_read for r in dataset.recordings] == [1000, 505]


def test_piece_shorter_than_a_step_is_left_out(ingest: Ingest) -> None:
    warnings: list[str] = []
    text = logged(*np.arange(50) * 0.01, 7, 7.01, *(9 + np.arange(50) * 0.01))
    dataset = ingest({"a.csv": text}, gaps=SPLIT, resample=0.1, warnings=warnings)
    assert [c.size for c in dataset.curves] == [5, 5]
    assert "1 of 3 pieces" in warnings[0]


def test_sample_time_stands_for_a_time_column(ingest: Ingest) -> None:
    columns = {name: column for name, column in COLUMNS.items() if name != "time"}
    text = csv_text(t=7, P=80, eps=0, F=[1, 2, np.nan, 4])
    got = ingest({"a.csv": text}, columns=columns, sample_time=0.01, missing="drop").recordings[0]
    np.testing.assert_allclose(got.columns["time"], [0, 0.01, 0.03])


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    steps=st.lists(st.sampled_from([-1.0, 0.0, 0.1, 0.1, 0.1, 2.0]), min_size=2, max_size=40),
    holes=st.lists(st.booleans(), min_size=40, max_size=40),
)
def test_every_row_is_in_one_piece_or_counted(ingest: Ingest, steps: list[float], holes: list[bool]) -> None:
    t = np.cumsum(steps)
    force = np.where(holes[: len(t)], np.nan, np.arange(len(t)))
    try:
        dataset = ingest({"a.csv": logged(*t, F=force)}, gaps=SPLIT, missing="drop", repeated_time="average")
    except DataError:
        assert np.isnan(force).all()
        return
    assert sum(r.rows_read for r in dataset.recordings) == len(t)
    for recording in dataset.recordings:
        assert recording.rows_kept + sum(recording.dropped.values()) == recording.rows_read
        assert (np.diff(recording.columns["time"]) > 0).all()
        assert (np.diff(recording.columns["time"]) <= 0.15).all()
