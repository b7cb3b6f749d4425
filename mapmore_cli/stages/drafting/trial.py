"""A draft is tried in memory: its model is made of its own data, and scored as a run would score it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import OWN, Score, deciding
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.scores.rows import divisor, on_common_rows, score_rows
from mapmore_cli.stages import fuse
from mapmore_cli.stages.inspection.evidence import two_digits
from mapmore_cli.stages.kinds import refitted
from mapmore_cli.stages.validate import scored_as

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
    choices = fuse.reads(loaded.spec)
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
    model = refitted(fuse.reads(loaded.spec), dataset)
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
