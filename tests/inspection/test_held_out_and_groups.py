"""What a person says of what is held out and of groups, by the numbers of the list that `init`
prints; and what a draft costs.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from recorded import checked, drafted, write

from mapmore_cli.annexes.drafting.answers import answers_of
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.errors import UsageError

DATASETS = Path(__file__).parents[2] / "datasets"
K = np.arange(60)


def pulls(folder, stronger=0.001):
    """Two specimens at each pressure, numbered in a column; the second is so much stronger."""
    for level in (100, 200, 300, 400):
        strain = 0.003 * K
        for specimen in (1, 2):
            force = (1 + stronger * specimen) * level * (2 - 9 * strain)
            columns = {"P [kPa]": level, "eps": strain, "No of specimen": specimen, "F [N]": force}
            write(folder / f"pull_{level}_take{specimen}.csv", columns)


@pytest.mark.parametrize(
    ("said", "held_out"),
    [
        ("P [kPa]", {"pressure": [300]}),
        ("eps", {"strain": {"between": [[0.0708, 0.106]]}}),
        ("1", {"strain": {"between": [[0.0708, 0.106]]}}),
    ],
)
def test_what_is_held_out_is_what_a_person_says(tmp_path, said, held_out):
    pulls(tmp_path)
    draft = drafted(tmp_path, answers=answers_of(validate=said, inputs="P,eps"))
    assert draft.data["split"] == {"validate": held_out}
    checked(draft, tmp_path)


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("F [N]", "is not an input"),
        ("9", "no column"),
    ],
)
def test_what_cannot_be_held_out_is_told(tmp_path, said, why):
    write(tmp_path / "pull.csv", {"P [kPa]": 100 + K, "eps": 0.003 * (K % 7), "F [N]": 3.0 * K**2})
    with pytest.raises(UsageError, match=why):
        start(tmp_path, tmp_path, answers=answers_of(validate=said))


@pytest.mark.parametrize("said", ["2", "No_of_specimen"])
def test_a_column_may_tell_groups_apart(tmp_path, said):
    pulls(tmp_path, 0.5)
    draft = drafted(tmp_path, answers=answers_of(group=said))
    assert draft.data["groups"]["of"] == "No_of_specimen"
    assert draft.data["files"] == ["pull_*.csv"]
    assert checked(draft, tmp_path).spec.data.groups.of == "No_of_specimen"


def test_the_number_that_is_shown_is_the_number_that_is_taken(tmp_path):
    """A column of dates before them moved all numbers by one."""
    rows = [f"2031-05 {k % 3},{k},{np.sin(k / 9):.4f},{np.cos(k / 7):.4f}" for k in range(300)]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n")
    with pytest.raises(UsageError, match="do not say") as refused:
        start(tmp_path, tmp_path)
    assert "\n  2  column 2" in refused.value.message
    assert "--target force=3:N --inputs pressure=2:bar" in refused.value.remedy
    draft = drafted(tmp_path, answers=answers_of(target="2", inputs="3"))
    assert draft.data["columns"]["column_2"] == {"column": 2}
    assert draft.output == "column_2"


def test_a_column_that_a_person_names_is_no_clock(tmp_path):
    x, y = np.meshgrid(np.arange(21.0), np.arange(21.0))
    write(tmp_path / "scan.csv", [x.ravel(), y.ravel(), np.sin(x * y).ravel()], "")
    draft = drafted(tmp_path, answers=answers_of(target="signal=2:V", inputs="x=0:mm,y=1:mm"))
    assert set(draft.data["columns"]) == {"x", "y", "signal"}
    timed = drafted(tmp_path, answers=answers_of(target="signal=2:V", inputs="x=0:mm,time=1:s"))
    assert timed.data["columns"]["time"] == {"column": 1, "unit": "s"}


@pytest.mark.parametrize("folder", ["mckibben", "wrist"])
def test_a_draft_of_a_shipped_folder_takes_a_second(folder, tmp_path):
    """Its whole command takes two: the rest is to begin."""
    begin = time.process_time()
    assert start(DATASETS / folder, tmp_path).drafts
    assert time.process_time() - begin < 1.0
