"""No proposal of `init` fails its own `check` or `run`, whatever a folder holds.

`MAPMORE_EXAMPLES=2000` tries as many folders of each kind, each time others, for as long as it takes. One that fails is then shown as it
is: to make it smaller takes up to five minutes more.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from generated_folders import KINDS, Folder, folders
from hypothesis import HealthCheck, Phase, given, settings

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.loader import load
from mapmore_cli.study.drafting.answers import Answers
from mapmore_cli.study.drafting.start import start
from mapmore_cli.study.inspection.lint import inspect

MORE = os.environ.get("MAPMORE_EXAMPLES")
UNUSABLE = ("no table of numbers", "no two columns of numbers move", "too few training samples", "a single column, and no other")
PHASES = (Phase.generate,) if MORE else tuple(Phase)


@pytest.mark.timeout(0 if MORE else 300)
@pytest.mark.parametrize(("kind", "examples"), [(kind, 5 if kind == "text" else 1) for kind in KINDS])
def test_no_proposal_fails_its_own_check_or_run(tmp_path_factory: pytest.TempPathFactory, kind: str, examples: int) -> None:
    @settings(
        deadline=None, max_examples=int(MORE or examples), derandomize=MORE is None, phases=PHASES, suppress_health_check=list(HealthCheck)
    )
    @given(folders([kind]))
    def holds(campaign: Folder) -> None:
        place = tmp_path_factory.mktemp(kind)
        campaign.save(place)
        hold_true(place, campaign.length)

    holds()


def hold_true(place: Path, length: float | None) -> None:
    """Every draft of a folder passes its check and its run, and holds out what is there; a folder without any says why of every file."""
    try:
        drafts = start(place, place, answers=Answers(length=length)).drafts
    except DataError as refusal:
        assert any(words in str(refusal) for words in UNUSABLE), refusal  # noqa: PT017 - a word on every file
        return
    for draft in drafts:
        path = place / f"{draft.name}.yaml"
        path.write_text(draft.text(), encoding="utf-8")
        loaded = load(path)
        found = inspect(loaded)
        assert found.verdict is None, draft.text()
        assert found.dataset is not None
        for level in held_out_levels(loaded.spec):
            assert has_samples(found.dataset, level), draft.text()
        bring_up_to_date(loaded, place / "runs", until="validate")


def held_out_levels(spec: ExperimentSpec) -> list[float]:
    """The levels that a spec holds out."""
    held = spec.data.split.hold_out
    values = held.quantities.get(spec.data.levels.of) if held is not None and spec.data.levels is not None else None
    return values if isinstance(values, list) else []


def has_samples(dataset: Dataset, level: float) -> bool:
    """True where a curve at the level is held out."""
    return any(curve.level == pytest.approx(level) and curve.held_out.any() for curve in dataset.curves)
