"""Specimens that the names of files tell apart: studies of their own, or groups of one study where somebody says so."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.ingestion.files import expand
from mapmore_cli.pipeline.search import reads
from mapmore_cli.spec.loader import load
from mapmore_cli.study.drafting import start as drafting
from mapmore_cli.study.drafting.answers import Answers
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.inspection.lint import inspect


@settings(max_examples=12)
@given(
    words=st.sampled_from(
        [
            ("red", "green", "blue"),
            ("left", "right"),
            ("10cm", "20cm"),
            ("S1", "S2", "S12"),
            ("Sample 1", "Sample 2"),
            ("muscleA", "muscleB"),
            ("specimen-3", "specimen-10"),
            ("actuator_1", "actuator_2"),
        ]
    ),
    bars=st.lists(st.integers(1, 9), min_size=2, max_size=4, unique=True),
    first=st.booleans(),
)
def test_specimens_that_names_tell_apart_are_never_pooled_unasked(words: tuple[str, ...], bars: list[int], first: bool) -> None:
    with TemporaryDirectory() as place, pytest.MonkeyPatch.context() as patch:
        folder = Path(place)
        patch.setattr(drafting, "proven", lambda draft, _: draft)
        for number, word in enumerate(words):
            for bar in bars:
                name = f"{word}_pull_{bar}bar.csv" if first else f"pull_{word}_{bar}bar.csv"
                rows = [f"{100 * bar},{k / 300},{(2 + number) * 100 * bar - 900 * k}" for k in range(40)]
                (folder / name).write_text("\n".join(["P_kPa,eps,F_N", *rows]) + "\n")
        apart = drafting.start(folder, folder).drafts
        assert len(apart) == len(words)
        for draft in apart:
            files = {path.name for path in expand_all(draft, folder)}
            assert len(files) == len(bars)
            assert any(all(word in name for name in files) for word in words)
        (pooled,) = drafting.start(folder, folder, answers=Answers(group="none")).drafts
        assert "groups" not in pooled.data
        (grouped,) = drafting.start(folder, folder, answers=Answers(group="specimen")).drafts
        assert grouped.data["groups"] == {"of": "specimen"}
        assert len(expand_all(grouped, folder)) == len(words) * len(bars)
        assert {entry["set"]["specimen"] for entry in grouped.data["files"]} == set(range(1, len(words) + 1))


def expand_all(draft: Draft, folder: Path) -> list[Path]:
    """The files that a draft reads."""
    return [path for entry in draft.data["files"] for path in expand(entry if isinstance(entry, str) else entry["path"], folder)]


def test_the_groups_are_no_input_of_a_search(tmp_path: Path) -> None:
    for number in (1, 2):
        for bar in (1, 2, 3):
            rows = [f"{100 * bar},{k / 300},{(2 + number / 10) * 100 * bar - 9 * k}" for k in range(40)]
            (tmp_path / f"{10 * number}cm_pull_{bar}bar.csv").write_text("\n".join(["P_kPa,eps,F_N", *rows]) + "\n")
    (draft,) = drafting.start(tmp_path, tmp_path, answers=Answers(group="specimen")).drafts
    path = tmp_path / "spec.yaml"
    path.write_text(draft.text(), encoding="utf-8")
    loaded = load(path)
    assert inspect(loaded).verdict is None
    assert reads(loaded.spec).ignored == ("force", "specimen")
