"""Cycles of a driven quantity that are held out, and samples of single files that are left out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ingest_samples import Ingest, csv_text

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.modelling.signals.cycles import last_cycles

SPLIT = {"longer_than": 5.0, "action": "split"}
HALF = {"validate": {"last_cycles": 0.5, "of": "pressure"}}
LENGTH = 100
"""Samples of a cycle: rest, rise, fall."""


def driven(cycles: int, rest: float = 10.0, gaps: tuple[int, ...] = ()) -> str:
    """Pressure cycles, a sample each second, with a pause of a minute before each sample of `gaps`."""
    one = np.interp(np.arange(LENGTH), [0, 20, 60, LENGTH], [0, 0, 300, 0])
    pressure = rest + np.tile(one, cycles)
    pause = np.zeros(len(pressure))
    pause[list(gaps)] = 60.0
    return csv_text(t=np.arange(len(pressure)) + np.cumsum(pause), P=pressure, eps=pressure / 1e4, F=np.arange(len(pressure)))


def held(dataset: Dataset) -> np.ndarray:
    return np.concatenate([curve.held_out for curve in dataset.curves])


@pytest.mark.parametrize(("cycles", "trained"), [(2, 1), (3, 2), (4, 2), (5, 3)])
def test_the_later_cycles_are_held_out_and_the_larger_part_trains(ingest: Ingest, cycles: int, trained: int) -> None:
    mask = held(ingest({"a.csv": driven(cycles)}, split=HALF))
    first = int(np.argmax(mask))
    assert mask[first:].all()
    assert trained * LENGTH <= first <= trained * LENGTH + 30  # from the end of its rest, at the latest 5 % up the rise


def test_cycles_are_counted_over_all_pieces_of_a_log(ingest: Ingest) -> None:
    """A gap within the second of four cycles, and one before the last."""
    dataset = ingest({"a.csv": driven(4, gaps=(140, 310))}, gaps=SPLIT, split=HALF)
    whole = ingest({"a.csv": driven(4)}, split=HALF)
    assert [curve.id for curve in dataset.curves] == ["a#1", "a#2", "a#3"]
    assert [int(curve.held_out.sum()) for curve in dataset.curves[::2]] == [0, 90]
    np.testing.assert_array_equal(held(dataset), held(whole))


def test_each_log_has_its_own_cycles(ingest: Ingest) -> None:
    dataset = ingest({"a.csv": driven(2), "b.csv": driven(4, rest=40.0)}, split=HALF)
    alone = [held(ingest({f"{n}.csv": driven(n)}, files=[f"{n}.csv"], split=HALF)) for n in (2, 4)]
    np.testing.assert_array_equal(held(dataset), np.concatenate(alone))


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(gaps=st.sets(st.integers(1, 399), max_size=6), share=st.sampled_from([0.25, 0.5, 0.75]))
def test_levels_and_gaps_do_not_change_which_samples_are_held_out(ingest: Ingest, gaps: set[int], share: float) -> None:
    split = {"validate": {"last_cycles": share, "of": "pressure"}}
    levels = {"of": "pressure", "at": [10.0, 300.0], "within": 145.0}
    dataset = ingest({"a.csv": driven(4, gaps=tuple(sorted(gaps)))}, gaps=SPLIT, split=split, levels=levels)
    number = np.concatenate([curve.columns["force"] for curve in dataset.curves])
    pressure = np.concatenate([curve.columns["pressure"] for curve in dataset.curves])
    order = np.argsort(number)
    np.testing.assert_array_equal(held(dataset)[order], last_cycles(pressure[order], share))


def test_cycles_can_be_those_of_one_recording(ingest: Ingest) -> None:
    split = {"validate": {"recordings": ["b"], "last_cycles": 0.5, "of": "pressure"}}
    dataset = ingest({"a.csv": driven(2), "b.csv": driven(2)}, split=split)
    assert [curve.held_out.any() for curve in dataset.curves] == [False, True]


REFUSED: dict[str, tuple[str, dict[str, Any], type[Exception], list[str]]] = {
    "one cycle": (driven(1), {}, DataError, ["a.csv, cycles of pressure: 1 cycle(s)", "`last: 0.5`"]),
    "no motion": (csv_text(t=np.arange(50), P=5, eps=0, F=0), {}, DataError, ["a.csv, cycles of pressure: 0 cycle(s)"]),
    "load cycles": (driven(2), {"cycles": {"over": "strain"}}, SpecError, ["`last_cycles` needs samples in the order of time"]),
}


@pytest.mark.parametrize("case", REFUSED)
def test_recordings_without_cycles_to_part(ingest: Ingest, case: str) -> None:
    text, data, error, parts = REFUSED[case]
    with pytest.raises(error) as caught:
        ingest({"a.csv": text}, split=HALF, **data)
    assert all(part in str(caught.value) for part in parts), str(caught.value)


def test_an_interval_is_left_out_with_both_its_ends(ingest: Ingest) -> None:
    text = csv_text(t=np.arange(10), P=80, eps=0, F=0)
    (recording,) = ingest({"a.csv": text}, keep=[{"quantity": "time", "outside": (3.0, 6.0)}]).recordings
    np.testing.assert_array_equal(recording.columns["time"], [0, 1, 2, 7, 8, 9])
    assert dict(recording.dropped) == {"time from 3 to 6 s": 4}


def test_samples_of_one_file_are_left_out_and_no_others(ingest: Ingest) -> None:
    text = csv_text(t=np.arange(10), P=80, eps=0, F=0)
    files = [{"path": "a.csv", "keep": [{"quantity": "time", "above": 3.0}, {"quantity": "time", "below": 9.0}]}, "b.csv"]
    dataset = ingest({"a.csv": text, "b.csv": text}, files=files, keep=[{"quantity": "time", "below": 8.0}])
    assert [list(recording.columns["time"]) for recording in dataset.recordings] == [[4, 5, 6, 7], list(range(8))]
    assert [dict(recording.dropped) for recording in dataset.recordings] == [{"time >= 8 s": 2, "time <= 3 s": 4}, {"time >= 8 s": 2}]
