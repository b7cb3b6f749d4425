"""What `init` writes in the end: one study or several of specimens, its page, and the table of
measured data.

Quick folders of measured data are tried here, `docs/drafted_tables.py` tries all.
"""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import checked, drafted, write

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.search.stage import search_slice
from mapmore_cli.ingestion.globs import expand

# Specimens that the names of files tell apart
# --------------------------------------------------------------------------------------


def pull(path, bar, strength):
    k = np.arange(40)
    write(
        path,
        {"P_kPa": 100 * bar, "eps": k / 300, "F_N": 100 * bar * strength - 9 * k + 0.02 * k**2},
    )


SPECIMENS = [
    *(
        ("red", "green", "blue"),
        ("left", "right"),
        ("10cm", "20cm"),
        ("S1", "S2", "S12"),
        ("Sample 1", "Sample 2"),
    ),
    *(("muscleA", "muscleB"), ("specimen-3", "specimen-10"), ("actuator_1", "actuator_2")),
]


@settings(max_examples=12)
@given(
    words=st.sampled_from(SPECIMENS),
    bars=st.lists(st.integers(1, 9), min_size=2, max_size=4, unique=True),
    first=st.booleans(),
)
def test_specimens_are_one_study_and_groups_where_a_person_says_so(words, bars, first):
    with TemporaryDirectory() as place:
        folder = Path(place)
        for number, word in enumerate(words):
            for bar in bars:
                pull(
                    folder
                    / (f"{word}_pull_{bar}bar.csv" if first else f"pull_{word}_{bar}bar.csv"),
                    bar,
                    2 + number,
                )
        pooled = drafted(folder)
        assert "groups" not in pooled.data
        assert len(expand_all(pooled, folder)) == len(words) * len(bars)
        grouped = drafted(folder, answers=Answers(group="specimen"))
        # what explains the difference at equal inputs is switched on
        assert grouped.data["groups"]["of"] == "specimen"
        assert {*grouped.data["groups"].values()} <= {"specimen", True}
        for number in range(1, len(words) + 1):
            own = [entry for entry in grouped.data["files"] if entry["set"]["specimen"] == number]
            names = [path.name for entry in own for path in expand(entry["path"], folder)]
            assert len(names) == len(bars)
            assert any(all(re.search(rf"{word}(?!\d)", name) for name in names) for word in words)


def expand_all(draft, folder):
    """The files that a draft reads."""
    return [
        path
        for entry in draft.data["files"]
        for path in expand(entry if isinstance(entry, str) else entry["path"], folder)
    ]


def test_the_groups_are_no_input_of_a_search(tmp_path):
    for number in (1, 2):
        for bar in (1, 2, 3):
            pull(tmp_path / f"{10 * number}cm_pull_{bar}bar.csv", bar, 2 + number / 10)
    spec = checked(drafted(tmp_path, answers=Answers(group="specimen")), tmp_path).spec
    assert search_slice(spec).ignored == ("force", "specimen")
