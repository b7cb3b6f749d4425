"""A draft is tried in memory: its model is made of its own data, and scored as a run would score it."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import OWN, Score, deciding
from mapmore_cli.fitting.kinds import refitted
from mapmore_cli.fitting.kinds.choices import model_choices
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import forecast
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces.backbone_choice import FEW
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.modelling.validation.metrics import divisor, on_common_rows, score_rows
from mapmore_cli.pipeline.validate import scored_as
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.yaml_loader import dump
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.inspection.evidence import two_digits
from mapmore_cli.study.inspection.lint import inspect

if TYPE_CHECKING:
    from mapmore_cli.spec.loader import LoadedSpec


MOST_SAMPLES = 6_000  # of a model without memory: every curve gives an even share
MOST_STEPS = 20_000  # of one with memory, which needs them all
WORSE = 1.02  # times the error of a polynomial, from which a model is worse


@dataclass(frozen=True)
class Trial:
    """The scores of a draft's own model, and of the best polynomial among its competitors."""

    own: Score
    polynomial: Score | None = None

    @property
    def bad(self) -> bool:
        """True where the mean of what was measured, or a polynomial, says more of the data, or nothing can be said."""
        return not np.isfinite([self.own.rmse, self.own.nrmse]).all() or self.own.r2 <= 0 or self._beaten

    @property
    def _beaten(self) -> bool:
        return self.polynomial is not None and self.own.rmse > WORSE * self.polynomial.rmse

    def __str__(self) -> str:
        where = "on held-out data" if self.own.split == "validate" else "on its training data"
        if not np.isfinite(self.own.rmse):
            return f"no finite error {where}"
        if not np.isfinite(self.own.nrmse):
            return f"no NRMSE {where}: the measured values are zero, or all alike"
        told = f"NRMSE {_per_cent(self.own)} {where}"
        if self.own.r2 <= 0:
            told += ", worse than their mean"
        return f"{told}; {self.polynomial.model} has {_per_cent(self.polynomial)}" if self.polynomial and self._beaten else told


def _per_cent(score: Score) -> str:
    """The error in per cent, two digits of it."""
    return f"{two_digits(100 * score.nrmse):g} %" if score.nrmse else "0 %"


def tried(loaded: LoadedSpec, dataset: Dataset) -> Trial | None:
    """Make the model of a spec of its dataset, and score it beside its polynomials; None where that would take long.

    Long curves give an even share of their samples, where the model has no memory. Raises as a run would.
    """
    choices = model_choices(loaded.spec)
    if choices.over_time:
        return _scored(loaded, dataset) if sum(curve.size for curve in dataset.curves) <= MOST_STEPS else None
    most = max(MOST_SAMPLES // max(len(dataset.curves), 1), 1)
    return _scored(loaded, replace(dataset, curves=tuple(_thinned(curve, most) for curve in dataset.curves)))


def _thinned(curve: Curve, most: int) -> Curve:
    """One sample in so many of a curve."""
    rows = np.arange(0, curve.size, -(-curve.size // most))
    columns = {name: values[rows] for name, values in curve.columns.items()}
    origin = None if curve.origin is None else curve.origin[rows]
    return replace(curve, columns=columns, held_out=curve.held_out[rows], origin=origin)


def _scored(loaded: LoadedSpec, dataset: Dataset) -> Trial:
    model = refitted(model_choices(loaded.spec), dataset)
    validation = loaded.spec.validation
    scored = dataset if validation.as_ is None else scored_as(validation.as_, dataset, model)
    said: dict[str, Sequence[Forecast]] = {OWN: [forecast(model, curve, scored.target) for curve in scored.curves]}
    polynomials = [name for name in validation.against if isinstance(name, str) and name.startswith("polynomial")]
    said |= {name: found for name in polynomials for found in _of_formula(name, scored)}
    scale = divisor(scored, validation.normaliser)
    rows = [row for name, found in on_common_rows(said).items() for row in score_rows(name, scored.target, found, scored, scale)]
    own, *others = deciding(rows)
    return Trial(own, min(others, key=lambda row: row.rmse, default=None))


def _of_formula(name: str, dataset: Dataset) -> Iterator[Sequence[Forecast]]:
    """What a formula says of every curve; nothing where its fit fails."""
    fit = fit_formula(name, dataset.curves, dataset.target, advice=False)
    if not fit.failed:
        yield [Forecast.of(literature.get(name).predict(fit.parameters, curve.columns)) for curve in dataset.curves]


def proven(draft: Draft, folder: Path) -> Draft:
    """The draft, or the first of its simpler forms that passes, with what it scored; DataError where none does."""
    faults: list[str] = []
    for candidate in _simpler(draft):
        try:
            trial = _tried(candidate, folder)
        except MapmoreError as fault:
            faults.append(fault.message)
            continue
        return _told(candidate.noted(("target",), _why(candidate, faults[0]), False) if faults else candidate, trial)
    raise DataError(f"{draft.name}: {faults[0]}", "write the spec by hand")


def _told(draft: Draft, trial: Trial | None) -> Draft:
    """The draft with what its model scored; marked where the mean or a polynomial is better."""
    if trial is None:
        return draft
    chosen = draft.spec.get("model", {}).get("backbone") == AUTO
    before = draft.notes.get(("target",))
    told = f"tried{f' with the backbone {FEW}' if chosen else ''}: {trial}"
    doubtful = trial.bad and not (chosen and trial.own.r2 > 0)  # the choice has the polynomials as well
    return draft.noted(("target",), told if before is None else f"{before.why}; {told}", not doubtful and (before is None or before.sure))


def _why(draft: Draft, fault: str) -> str:
    before = draft.notes.get(("target",))
    told = f"made simpler, as {' '.join(fault.split())[:160]}"
    return told if before is None else f"{before.why}; {told}"


def _simpler(draft: Draft) -> Iterator[Draft]:
    """The draft, then without one thing after the other that data may be too few or too odd for."""
    yield draft
    steps: tuple[Callable[[Draft], Draft], ...] = (
        lambda one: one.without("model", "validate"),
        lambda one: one.without("segment"),
        lambda one: one.with_section("fit", {"max_terms": 1}),
        lambda one: one.without_data("cycles", "keep", "derive"),
        lambda one: one.without_data("split"),
        lambda one: one.without("segment").without_data("levels"),
    )
    for step in steps:
        simpler = step(draft)
        if simpler.spec != draft.spec:
            draft = simpler
            yield draft
    yield _straight(draft)


def _straight(draft: Draft) -> Draft:
    """A straight line over the first input: the least that is a model."""
    target = draft.spec["target"]
    output = target["column"] if isinstance(target, dict) else "force"
    beside = [name for entry in draft.data["files"] if isinstance(entry, dict) for name in entry.get("set", {})]
    inputs = [name for name in (*draft.data["columns"], *beside) if name not in ("time", output)]
    draft = draft.without_data("resample", "gaps")
    return draft.with_section("dictionary", [{"polynomial": {"of": inputs[:1], "order": 1}}])


def _tried(draft: Draft, folder: Path) -> Trial | None:
    """The scores of a draft; MapmoreError for what `check` or `run` has against it."""
    with TemporaryDirectory() as place:
        path = Path(place) / "draft.yaml"
        path.write_text(dump(_chosen(_absolute(draft.spec, folder))), encoding="utf-8")
        loaded = load(path)
        found = inspect(loaded)
        if found.verdict is not None:
            raise DataError("; ".join(issue.message for issue in found.issues if issue.severity == "error"))
        return None if found.dataset is None else tried(loaded, found.dataset)


def _chosen(spec: dict[str, Any]) -> dict[str, Any]:
    """The spec with the backbone named that a choice falls back to: the choice leaves out what cannot be fitted, and takes its time."""
    model = spec.get("model", {})
    return {**spec, "model": {**model, "backbone": FEW}} if model.get("backbone") == AUTO else spec


def _absolute(spec: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The spec with paths that mean the same from anywhere."""
    start = glob.escape(str(folder.resolve()))

    def moved(log: dict[str, Any]) -> dict[str, Any]:
        files = [{**entry, "path": f"{start}/{entry['path']}"} if isinstance(entry, dict) else f"{start}/{entry}" for entry in log["files"]]
        return {**log, "files": files}

    data = moved(spec["data"])
    return {**spec, "data": {**data, "join": [moved(log) for log in data["join"]]} if "join" in data else data}
