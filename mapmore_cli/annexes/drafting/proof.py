"""The structure of a draft is searched on its training data; the model is then made in memory, and
scored as a run would score it.
"""

from __future__ import annotations

from dataclasses import replace
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
from mapmore_cli.spec.loader import load_text
from mapmore_cli.spec.yaml_loader import dump

if TYPE_CHECKING:
    from mapmore_cli.fitting.stage import Progress
    from mapmore_cli.spec.loader import LoadedSpec

BUDGET = 20.0
"""Seconds of computing time of each process, in which the structure of a draft is searched."""

MODEL = ("segment", "dictionary", "model", "fit", "fuse")
EXPERIMENT = ("cycles", "keep", "derive", "split", "levels", "resample", "gaps")


def scored(loaded: LoadedSpec, dataset: Dataset) -> tuple[Score, Score | None]:
    """Make the model of a spec of its dataset, and return its score and the best one of formulas
    and plainer models. Raises as a run would.
    """
    model = refit(model_choices(loaded.spec), dataset)
    validation = loaded.spec.validation
    contest = Contest(dataset, model, {}, None, loaded.spec.muscle.lengths, loaded.folder)
    formulas = [one for one in validation.against if isinstance(one, str)]
    rivals = [contest.rival(name) for name in (*formulas, *contest.simple_beside(formulas))]
    forecasts = {OWN: tuple(forecast(model, curve, dataset.target) for curve in dataset.curves)}
    forecasts |= {one.name: one.forecasts for one in rivals if not one.failed}
    scale = divisor(dataset, validation.normaliser)
    rows = [
        row
        for name, own in on_common_rows(forecasts).items()
        for row in score_rows(name, dataset.target, own, dataset, scale)
    ]
    own_score, *others = deciding(rows)
    known = [row for row in others if np.isfinite(row.rmse)]
    return own_score, min(known, key=lambda row: row.rmse, default=None)


def score_in_words(own: Score, plainer: Score | None) -> str:
    """Return the error of a draft in words, and that of a plainer model that errs less."""
    where = "on held-out data" if own.split == "validate" else "on its own training data"
    if not np.isfinite([own.rmse, own.nrmse]).all():
        return f"no finite error {where}"
    told = f"NRMSE {_per_cent(own)} {where}" + (", worse than their mean" if own.r2 <= 0 else "")
    if plainer is None or plainer.rmse >= own.rmse or _per_cent(plainer) == _per_cent(own):
        return told
    return f"{told}; {plainer.model} has {_per_cent(plainer)} there"


def _per_cent(score: Score) -> str:
    return f"{two_digits(100 * score.nrmse):g} %" if score.nrmse else "0 %"


def proven(
    draft: Draft, folder: Path, budget: float | None = None, progress: Progress = lambda *_: None
) -> Draft:
    """Return the draft with the structure that a search finds, and what it scored. Where data are
    too few for it, nothing is held out or at a level, and at last it is a straight line.

    The search takes `budget` seconds of computing time, by default `BUDGET`.
    Raises DataError where there is no model.
    """
    seconds = BUDGET if budget is None else budget
    before = draft.notes.get(("target",), Note(""))
    bare = draft.without("validate", *MODEL, *(f"data.{key}" for key in EXPERIMENT))
    line = [{"polynomial": {"of": _inputs_of(draft)[:1], "order": 1}}]
    faults: list[str] = []
    for candidate in (draft, bare, bare.with_section("dictionary", line)):
        try:
            made, told = _tried(candidate, folder, seconds, progress)
        except MapmoreError as fault:
            faults.append(" ".join(fault.message.split()))
            continue
        simpler = f"made simpler, as {faults[0][:160]}" if faults else ""
        why = "; ".join(filter(None, (before.why, simpler, f"tried: {told}")))
        return made.noted(("target",), why, before.sure and not faults)
    raise DataError(f"{draft.name}: {faults[0]}", "write the spec by hand")


def _inputs_of(draft: Draft) -> list[str]:
    entries = [entry for entry in draft.data["files"] if isinstance(entry, dict)]
    beside = [name for entry in entries for name in entry.get("set", {})]
    return [one for one in (*draft.data["columns"], *beside) if one not in ("time", draft.output)]


def _tried(draft: Draft, folder: Path, budget: float, progress: Progress) -> tuple[Draft, str]:
    """Return the draft with a model, and what it scored; MapmoreError for what `check`, `run` or
    the search have against it.
    """
    if "dictionary" not in draft.spec:
        model = {"type": AUTO, "budget": budget}
        loaded, dataset = _inspected({**draft.without("validate").spec, "model": model}, folder)
        structure = search(dataset, search_slice(loaded.spec), progress, beside=False)
        draft = _with_structure(draft, structure)
    return draft, score_in_words(*scored(*_inspected(draft.spec, folder)))


def _inspected(spec: dict[str, Any], folder: Path) -> tuple[LoadedSpec, Dataset]:
    loaded = load_text(dump(spec), "draft.yaml", folder)
    inspection = inspect(loaded)
    if inspection.verdict is not None or inspection.dataset is None:
        errors = [issue for issue in inspection.issues if issue.severity == "error"]
        raise DataError("; ".join(f"{issue.message}; {issue.remedy}" for issue in errors))
    return loaded, inspection.dataset


def _with_structure(draft: Draft, found: Search) -> Draft:
    """Return the draft with the sections that a search has found, and how."""
    sections: dict[str, Any] = {}
    for key, value in found.found.sections.items():
        section, _, inner = key.partition(".")
        sections[section] = {**sections.get(section, {}), inner: value} if inner else value
    for key in (key for key in MODEL if sections.get(key)):
        draft = draft.with_section(key, sections[key])
    cut = f", {found.cut} more not for want of time (--budget)" if found.cut else ""
    why = (
        f"found by search: {found.found.words}; of {len(found.tried)} structures{cut}, the "
        "simplest that errs as little as the best on left-out training data "
        f"({found.found.error:.2g} of the range)"
    )
    place = next(key for key in ("dictionary", "model", "segment") if sections.get(key))
    return replace(draft.noted((place,), why), found=found)
