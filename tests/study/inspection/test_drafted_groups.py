"""Specimens that the names of files tell apart: studies of their own, or groups of one study where somebody says so."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import checked, drafted, drafts, write

from mapmore_cli.ingestion.files import expand
from mapmore_cli.pipeline.search import reads
from mapmore_cli.study.drafting.answers import Answers
from mapmore_cli.study.drafting.draft import Draft


def pull(path: Path, bar: int, strength: float) -> None:
    k = np.arange(40)
    write(path, {"P_kPa": 100 * bar, "eps": k / 300, "F_N": 100 * bar * strength - 9 * k})


SPECIMENS = [
    *(("red", "green", "blue"), ("left", "right"), ("10cm", "20cm"), ("S1", "S2", "S12"), ("Sample 1", "Sample 2")),
    *(("muscleA", "muscleB"), ("specimen-3", "specimen-10"), ("actuator_1", "actuator_2")),
]


@settings(max_examples=12)
@given(
    words=st.sampled_from(SPECIMENS),
    bars=st.lists(st.integers(1, 9), min_size=2, max_size=4, unique=True),
    first=st.booleans(),
)
def test_specimens_that_names_tell_apart_are_never_pooled_unasked(words: tuple[str, ...], bars: list[int], first: bool) -> None:
    with TemporaryDirectory() as place:
        folder = Path(place)
        for number, word in enumerate(words):
            for bar in bars:
                pull(folder / (f"{word}_pull_{bar}bar.csv" if first else f"pull_{word}_{bar}bar.csv"), bar, 2 + number)
        apart = drafts(folder)
        assert len(apart) == len(words)
        for draft in apart:
            files = {path.name for path in expand_all(draft, folder)}
            assert len(files) == len(bars)
            assert any(all(word in name for name in files) for word in words)
        pooled = drafted(folder, answers=Answers(group="none"))
        assert "groups" not in pooled.data
        grouped = drafted(folder, answers=Answers(group="specimen"))
        assert grouped.data["groups"] == {"of": "specimen"}
        assert len(expand_all(grouped, folder)) == len(words) * len(bars)
        assert {entry["set"]["specimen"] for entry in grouped.data["files"]} == set(range(1, len(words) + 1))


def expand_all(draft: Draft, folder: Path) -> list[Path]:
    """The files that a draft reads."""
    return [path for entry in draft.data["files"] for path in expand(entry if isinstance(entry, str) else entry["path"], folder)]


def test_the_groups_are_no_input_of_a_search(tmp_path: Path) -> None:
    for number in (1, 2):
        for bar in (1, 2, 3):
            pull(tmp_path / f"{10 * number}cm_pull_{bar}bar.csv", bar, 2 + number / 10)
    loaded = checked(drafted(tmp_path, answers=Answers(group="specimen")), tmp_path)
    assert reads(loaded.spec).ignored == ("force", "specimen")
