"""Records that say little: without a clock, without a pressure or with it in a log of its own, with
an end beyond the rest.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorded import drafted, drafts, write

from mapmore_cli.annexes.drafting.answers import Answers, Hold, answers_of
from mapmore_cli.domain.errors import DataError


@pytest.fixture
def untried(tmp_path):
    """Drafts of a folder."""

    def of(hold=None, **tables):
        for name, columns in tables.items():
            write(tmp_path / f"{name}.csv", columns)
        return drafts(tmp_path, answers=Answers(hold=hold))

    return of


# The pressure
# --------------------------------------------------------------------------------------------------


def two_logs():
    """A tester that holds four strains, and a logger of the pressure that begins later and rests
    now and then.
    """
    t = 0.02 * np.arange(2400)
    strain = 0.05 * np.floor(t / 12)
    pressure = 200 * np.abs(np.sin(0.5 * t))
    logged = (t > 2) & (t % 12 < 11)
    return {
        "tester": {"Time_ms": 1000 * t, "strain": strain, "F_N": pressure * (2 - 8 * strain)},
        "gauge": {"Time_ms": 1000 * t[logged], "Pressure_kPa": pressure[logged]},
    }


def test_the_pressure_of_a_second_log_is_joined(untried):
    (draft,) = untried(Hold("strain"), **two_logs())
    (join,) = draft.data["join"]
    assert join["files"] == ["gauge.csv"]
    assert join["columns"]["pressure"] == {"column": "Pressure_kPa", "unit": "kPa"}
    assert (join["shift"], join["max_gap"]) == (0.0, 0.1)
    assert not draft.notes["data", "join"].sure
    assert draft.data["levels"]["of"] == "strain"


@pytest.mark.parametrize("log", ["gauge", "tester"])
def test_a_log_whose_clock_is_none_cannot_be_joined(untried, log):
    logs = two_logs()
    logs[log]["Time_ms"] = -logs[log]["Time_ms"]
    with pytest.raises(DataError) as caught:
        untried(**logs)
    assert "the two logs have no common clock" in (caught.value.remedy or "")


def test_a_second_log_is_shifted_if_its_changes_match_those_of_the_target(tmp_path):
    t = 0.02 * np.arange(2400)
    pressure = 200 + 100 * np.sign(np.sin(0.7 * t)) * np.sin(0.11 * t)
    write(tmp_path / "tester.csv", {"Time_ms": 1000 * t, "F_N": 2 * pressure})
    write(tmp_path / "gauge.csv", {"Time_ms": 1000 * (t + 3), "Pressure_kPa": pressure})
    draft = drafted(tmp_path, answers=answers_of(target="force", inputs="pressure"))
    (join,) = draft.data["join"]
    assert (join["shift"], join["match"]) == ("auto", {"first": "force", "second": "pressure"})
    note = draft.notes["data", "join"]
    assert note.sure
    assert note.why.startswith("the pressure is in a second log; shift -3")
