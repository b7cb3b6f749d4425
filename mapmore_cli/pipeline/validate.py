"""Score the model and its competitors, and write `validate.h5`, `scores.csv` and `scores.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.scores import OWN, Limit, deciding
from mapmore_cli.fitting.stage import Need, Stage, Workspace
from mapmore_cli.pipeline.scores_slice import ScoresSlice, scores_slice
from mapmore_cli.storage.run_folder import VALIDATION
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.results import Competitor
from mapmore_cli.study.yaml_dumper import as_overrides

if TYPE_CHECKING:
    from mapmore_cli.domain.scores import Score


def score(part: ScoresSlice, workspace: Workspace) -> None:
    """Score the models of a run. The modules for this are imported only when the stage runs."""
    from mapmore_cli.pipeline import scoring

    scoring.score(part, workspace)


def required_limits(
    require: Mapping[str, float | dict[str, float]], scores: Sequence[Score]
) -> tuple[Limit, ...]:
    """Return the limits in `validate.require`, each with the score of the run's own model that it
    limits.

    The limits apply to the scores on all held-out samples together, or on all training samples if
    nothing is held out. A limit that is a number applies to every output. A limit that is a mapping
    applies only to the outputs in it.
    """
    rows = deciding(score for score in scores if score.model == OWN)
    return tuple(
        Limit(
            metric,
            f"{row.model} ({row.target})" if len(rows) > 1 else row.model,
            row.split,
            float(getattr(row, metric)),
            limit[row.target] if isinstance(limit, dict) else limit,
        )
        for row in rows
        for metric, limit in require.items()
        if not isinstance(limit, dict) or row.target in limit
    )


def needs(spec: ExperimentSpec) -> list[Need]:
    """Return the other runs that the stage needs: the static run, because some competitors are
    fitted to its data; the runs with which this run is compared; and the variations of this run.
    """
    static = scores_slice(spec).static
    competitors = [c for c in spec.validation.against if isinstance(c, Competitor)]
    runs = dict.fromkeys(c.run for c in competitors if c.run not in (None, static))
    return [
        *([Need(static)] if static is not None else []),
        *(Need(str(path), compared=True) for path in runs),
        *(Need(c.label, as_overrides(c.set)) for c in competitors if c.set is not None),
    ]


def frozen_models(spec: ExperimentSpec, folder: Path) -> list[Path]:
    """Return the paths of the frozen models with which the model of this run is compared.

    Raises SpecError if one of these files is missing.
    """
    frozen = [c for c in spec.validation.against if isinstance(c, Competitor) and c.is_file]
    paths = [folder / str(competitor.model) for competitor in frozen]
    for competitor, path in zip(frozen, paths, strict=True):
        if not path.is_file():
            raise SpecError(
                f"validate.against: there is no model {competitor.model}",
                "freeze one with `mapmore freeze RUN --tag TAG`; paths are relative to the "
                "folder of the spec",
            )
    return paths


STAGE = Stage(
    name="validate",
    revision=15,
    outputs=(VALIDATION, "scores.csv", "scores.json"),
    reads=scores_slice,
    run=score,
    sources=frozen_models,
    needs=needs,
)
