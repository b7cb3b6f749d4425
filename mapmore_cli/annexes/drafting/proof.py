"""The structure of a draft is searched on its training data; the model is then made in memory, and
scored as a run would score it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.annexes.drafting.draft import Draft, Note
from mapmore_cli.annexes.search.searching import search
from mapmore_cli.annexes.search.stage import search_slice
from mapmore_cli.checking.evidence import two_digits
from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Search
from mapmore_cli.domain.scores import OWN, Score, deciding
from mapmore_cli.fitting.competitors import Contest
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.fitting.kinds.choices import model_choices
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.modelling.validation.metrics import divisor, on_common_rows, score_rows
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.pipeline.validate import scored_as
from mapmore_cli.spec.loader import load_text
from mapmore_cli.spec.yaml_loader import dump

if TYPE_CHECKING:
    from mapmore_cli.fitting.stage import Progress
    from mapmore_cli.spec.loader import LoadedSpec

BUDGET = 20.0
"""Seconds of computing time of each process, in which the structure of a draft is searched."""

WORSE, MUCH_WORSE = (
    1.02,
    1.2,
)  # times the error of a plainer model, from which a model is told to be worse, and is doubtful
MODEL = ("segment", "dictionary", "model", "fit", "fuse")


@dataclass(frozen=True)
class Trial:
    """The scores of a draft's own model, and of the best of those plainer ones that anybody would
    try first.
    """

    own: Score
    plainer: Score | None = None

    @property
    def bad(self) -> bool:
        """True where the mean of what was measured, or a plainer model, says much more of the data,
        or nothing can be said.
        """
        return (
            not np.isfinite([self.own.rmse, self.own.nrmse]).all()
            or self.own.r2 <= 0
            or self._beaten(MUCH_WORSE)
        )

    def _beaten(self, times: float) -> bool:
        return self.plainer is not None and self.own.rmse > times * self.plainer.rmse

    def __str__(self) -> str:
        def per_cent(score: Score) -> str:
            return f"{two_digits(100 * score.nrmse):g} %" if score.nrmse else "0 %"

        where = "on held-out data" if self.own.split == "validate" else "on its training data"
        if not np.isfinite(self.own.rmse):
            return f"no finite error {where}"
        if not np.isfinite(self.own.nrmse):
            return f"no NRMSE {where}: the measured values are zero, or all alike"
        told = f"NRMSE {per_cent(self.own)} {where}" + (
            ", worse than their mean" if self.own.r2 <= 0 else ""
        )
        return (
            f"{told}; {self.plainer.model} has {per_cent(self.plainer)} there"
            if self.plainer and self._beaten(WORSE)
            else told
        )


def scored(loaded: LoadedSpec, dataset: Dataset) -> Trial:
    """Make the model of a spec of its dataset, and score it beside formulas and plainer models.
    Raises as a run would.
    """
    model = refit(model_choices(loaded.spec), dataset)
    validation = loaded.spec.validation
    seen = dataset if validation.as_ is None else scored_as(validation.as_, dataset, model)
    contest = Contest(seen, model, {}, None, loaded.spec.muscle.lengths, loaded.folder)
    formulas = [one for one in validation.against if isinstance(one, str)]
    rivals = [contest.rival(name) for name in (*formulas, *contest.simple_beside(formulas))]
    said = {OWN: tuple(forecast(model, curve, seen.target) for curve in seen.curves)}
    said |= {one.name: one.forecasts for one in rivals if not one.failed}
    scale = divisor(seen, validation.normaliser)
    rows = [
        row
        for name, found in on_common_rows(said).items()
        for row in score_rows(name, seen.target, found, seen, scale)
    ]
    own, *others = deciding(rows)
    known = [row for row in others if np.isfinite(row.rmse)]
    return Trial(own, min(known, key=lambda row: row.rmse, default=None))


def proven(
    draft: Draft, folder: Path, budget: float | None = None, progress: Progress = lambda *_: None
) -> Draft:
    """Return the draft with the structure that a search finds, or the first of its simpler forms
    for which it does, and what it scored.

    The search takes `budget` seconds of computing time, by default `BUDGET`.
    Raises DataError where there is none.
    """
    faults: list[str] = []
    for candidate in _simpler(draft):
        try:
            found, trial = _tried(candidate, folder, BUDGET if budget is None else budget, progress)
        except MapmoreError as fault:
            faults.append(fault.message)
            continue
        before = found.notes.get(("target",), Note(""))
        simpler = [f"made simpler, as {' '.join(faults[0].split())[:160]}"] if faults else []
        why = "; ".join([*([before.why] if before.why else []), *simpler, f"tried: {trial}"])
        return found.noted(("target",), why, before.sure and not faults and not trial.bad)
    raise DataError(f"{draft.name}: {faults[0]}", "write the spec by hand")


def _simpler(draft: Draft) -> Iterator[Draft]:
    """Yield the draft, then without one thing after the other that data may be too few or too odd
    for, at last as a straight line.
    """
    yield draft
    for keys in (
        ("validate",),
        ("data.cycles", "data.keep", "data.derive"),
        ("data.split",),
        ("data.levels",),
    ):
        simpler = draft.without(*keys)
        if simpler.spec != draft.spec:
            draft = simpler
            yield draft
    beside = [
        name
        for entry in draft.data["files"]
        if isinstance(entry, dict)
        for name in entry.get("set", {})
    ]
    inputs = [
        name for name in (*draft.data["columns"], *beside) if name not in ("time", draft.output)
    ]
    draft = draft.without("data.resample", "data.gaps")
    yield draft.with_section(
        "dictionary",
        [{"polynomial": {"of": inputs[:1], "order": 1}}],
        "a straight line: the least that is a model",
    )


def _tried(draft: Draft, folder: Path, budget: float, progress: Progress) -> tuple[Draft, Trial]:
    """Return the draft with a model, and its scores; MapmoreError for what `check`, `run` or the
    search have against it.
    """

    def checked(spec: dict[str, Any]) -> tuple[LoadedSpec, Dataset]:
        loaded = load_text(dump(spec), "draft.yaml", folder)
        found = inspect(loaded)
        if found.verdict is not None or found.dataset is None:
            raise DataError(
                "; ".join(issue.message for issue in found.issues if issue.severity == "error")
            )
        return loaded, found.dataset

    if "dictionary" not in draft.spec:
        loaded, dataset = checked(
            {**draft.without("validate").spec, "model": {"type": AUTO, "budget": budget}}
        )
        draft = _with_structure(
            draft, search(dataset, search_slice(loaded.spec), progress, beside=False)
        )
    return draft, scored(*checked(draft.spec))


def _with_structure(draft: Draft, found: Search) -> Draft:
    """Return the draft with the sections that a search has found, and how."""
    sections: dict[str, Any] = {}
    for key, value in found.found.sections.items():
        section, _, inner = key.partition(".")
        sections[section] = {**sections.get(section, {}), inner: value} if inner else value
    for key in (key for key in MODEL if sections.get(key)):
        draft = draft.with_section(key, sections[key])
    tried = (
        f"{len(found.tried)} "
        f"structures{f', {found.cut} more not for want of time (--budget)' if found.cut else ''}"
    )
    why = (
        f"found by search: {found.found.words}; of {tried}, the simplest that errs as little "
        "as the best on left-out training data"
    )
    place = next(key for key in ("dictionary", "model", "segment") if sections.get(key))
    return replace(
        draft.noted((place,), f"{why} ({found.found.error:.2g} of the range)"), found=found
    )
