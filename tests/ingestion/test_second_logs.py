"""Second logs by hand: how they are paired, and what is told of a shift that was found."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from reading import refused

from mapmore_cli.ingestion import second_logs
from mapmore_cli.ingestion.samples import Samples, recordings_apart
from mapmore_cli.ingestion.second_logs import _found_shift, _ordered_signal, with_joined

COLUMN = SimpleNamespace(column="F")
UNITS = {"time": "ms", "P": "kPa", "P2": "kPa", "F": "N"}


def samples(label="a", **columns):
    size = len(next(iter(columns.values())))
    arrays = {name: np.array(values, dtype=float) for name, values in columns.items()}
    return Samples(arrays, np.arange(2, 2 + size), f"{label}.csv", doubts=(f"of {label}",))


def joined(monkeypatch, firsts, seconds):
    monkeypatch.setattr(second_logs, "_read", lambda *_: seconds)
    join = SimpleNamespace(on="row", quantities=["P"])
    log = SimpleNamespace(name="b.csv")
    source, data = SimpleNamespace(name="a.csv", joined=[log]), SimpleNamespace(join=[join])
    return with_joined(firsts, source, data, UNITS, None)


def test_recordings_of_two_logs_are_paired_or_one_is_for_all(monkeypatch):
    firsts = [samples(F=[1, 2]), samples(F=[3, 4])]
    seconds = [samples("b", P=[5, 6]), samples("c", P=[7, 8])]
    found = joined(monkeypatch, firsts, seconds)
    assert [one.columns["P"].tolist() for one in found] == [[5, 6], [7, 8]]
    assert [one.doubts for one in found] == [("of a", "of b"), ("of a", "of c")]
    found = joined(monkeypatch, firsts, seconds[:1])
    assert [one.columns["P"].tolist() for one in found] == [[5, 6], [5, 6]]
    with refused("b.csv: contains 2 recordings, but a.csv contains 1"):
        joined(monkeypatch, firsts[:1], seconds)


def test_recordings_of_one_table_are_in_order_and_the_first_has_the_notes_of_the_table():
    series = {"n": [2, 1, 2, 1], "F": [5, 6, np.nan, 8]}
    whole = replace(samples(**series), notes=("n",), element="run", titles={"F": "force"})
    data = SimpleNamespace(
        missing="drop", recordings=SimpleNamespace(quantities=["n"]), sample_time=0.1, every=3
    )
    first, second = recordings_apart(whole, data, UNITS, {"n": {"red": 2.0}})
    assert [one.columns["F"].tolist() for one in (first, second)] == [[5], [6, 8]]
    assert [one.rows.tolist() for one in (first, second)] == [[2], [3, 5]]
    assert [one.element for one in (first, second)] == ["run:n=red", "run:n=1"]
    assert second.columns["time"].tolist() == [0, 300]  # ms
    assert (first.notes, first.doubts) == (("n",), ("of a",))
    assert [(why, rows.tolist()) for why, rows in first.left_out.items()] == [
        ("missing value", [4])
    ]
    assert (second.notes, second.doubts, second.left_out) == ((), (), {})
    data.sample_time, data.missing, data.columns = None, "error", {"F": COLUMN}
    with refused("row 4, column force: the value of F is missing"):
        recordings_apart(whole, data, UNITS, {})
    data.recordings, data.missing = None, "drop"
    (alone,) = recordings_apart(whole, data, UNITS, {})
    assert alone.columns["F"].tolist() == [5, 6, 8]


def test_a_signal_has_the_first_of_equal_stamps_and_no_missing_values():
    first = samples(time=[0, 1, 1, np.nan, 3, 4], P=[5, 6, 7, 8, np.nan, 9])
    found = _ordered_signal(first, "P")
    assert [one.tolist() for one in found] == [[0, 1, 4], [5, 6, 9]]
    empty = _ordered_signal(samples(time=[np.nan], P=[1]), "P")
    assert [one.size for one in empty] == [0, 0]
    with refused("a.csv:row 6: time runs backwards"):
        _ordered_signal(samples(time=[0, 2, 2, np.nan, 1], P=[1, 1, 1, 1, 1]), "P")


def shift(monkeypatch, second="P2", is_found=True, **found):
    asked = []
    usual = {"value": -7.26, "half_width": 0.03, "correlation": 0.98765, "ratio": 2.0}
    usual |= {"lost_in_noise": False, "ambiguous": False, "rival": 4.0, "next_best": 0.5}

    def find(*signals, same_sign):
        asked.append(same_sign)
        return SimpleNamespace(**usual | found) if is_found else None

    monkeypatch.setattr(second_logs, "find_shift", find)
    join = SimpleNamespace(match=SimpleNamespace(first="P", second=second))
    first, other = samples(time=[0, 1], P=[0, 1]), samples("b", time=[0, 1], P2=[0, 1], F=[0, 1])
    return *_found_shift(first, other, join, UNITS), *asked


@pytest.mark.parametrize(
    ("half_width", "told"),
    [
        (0.03, "-7.260 \u00b1 0.03"),
        (0.3, "-7.26 \u00b1 0.3"),
        (3.0, "-7.3 \u00b1 3"),
        (30.0, "-7 \u00b1 30"),
    ],
)
def test_a_shift_is_told_with_one_digit_more_than_is_certain(monkeypatch, half_width, told):
    value, note, same_sign = shift(monkeypatch, half_width=half_width)
    assert (value, same_sign) == (-7.26, True)
    assert note == (
        f"b.csv: shift {told} ms, found from P2 and P (correlation of their changes 0.988, 2.00 "
        "times that of the next best shift)"
    )


def test_a_shift_between_different_quantities_may_include_a_lag(monkeypatch):
    _, note, same_sign = shift(monkeypatch, "F", ratio=np.inf)
    assert same_sign is False
    assert "no other shift fits nearly as well); if F physically lags behind P" in note


def test_a_shift_that_noise_could_give_or_another_one_rivals_is_refused(monkeypatch):
    with refused("P2 of b.csv and P of a.csv: the best candidate, -7.260 ms", "than noise"):
        shift(monkeypatch, lost_in_noise=True)
    with refused("a shift of 4 ms (correlation 0.500) fits nearly as well as -7.260 ms"):
        shift(monkeypatch, ambiguous=True)
    with refused("P2 of b.csv and P of a.csv, because one of them never changes"):
        shift(monkeypatch, is_found=False)
