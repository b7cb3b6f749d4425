"""A spec that leaves the backbone to the program."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli_samples import write_study


def test_the_run_tells_what_it_chose(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    """The study has three training levels: too few for a choice, which is said."""
    spec, runs = write_study(tmp_path), tmp_path / "runs"
    result = mapmore("validate", spec, "--runs", runs, "--set", "model.backbone=auto", "--set", "fit.max_terms=2")
    assert result.exit_code == 0, result.stderr
    shown = json.loads(mapmore("show", runs / "bench" / "model.h5", "--json").stdout)
    assert "too few to choose a backbone by" in " ".join(shown["notes"])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["segment={strain: {method: optimal, count: 2}}"], "`optimal` ones depend on the backbone"),
        (["dictionary=[{lags: {of: [force], steps: [1], order: 1}}]", "segment={}"], "a model with memory has none"),
    ],
)
def test_a_choice_that_cannot_be_made_is_refused(settings: list[str], words: str, tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    spec = write_study(tmp_path)
    given = [part for setting in ["model.backbone=auto", *settings] for part in ("--set", setting)]
    result = mapmore("fit", spec, "--runs", tmp_path / "runs", *given)
    assert result.exit_code == 3
    assert words in result.stderr
