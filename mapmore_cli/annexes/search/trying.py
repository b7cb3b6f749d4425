"""Try a structure: fit it to all training samples and without each fold, and refuse it if it
diverges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np
from pydantic import TypeAdapter

from mapmore_cli.annexes.search.bench import Bench, Slice
from mapmore_cli.annexes.search.black_boxes import SHOWN, Outcome
from mapmore_cli.annexes.search.candidate import BEYOND, Named, continuations
from mapmore_cli.domain.arrays import Array, BoolArray, Columns, extremes
from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import Tried
from mapmore_cli.fitting.kinds import refit_near
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.fitting.refitting import missed_by, without
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.kinds import fed_back, parameters, runs_over_time
from mapmore_cli.modelling.pieces.remarks import exploding_curves

_CHOICES = TypeAdapter(ModelChoices)

EMPTY: Named = {
    "segment": {},
    "dictionary": [],
    "model": {"type": "mapmore"},
    "fit": {},
}
"""Sections that define a structure, with their values if the structure does not set them."""


def choices_of(sections: Named, part: Slice) -> ModelChoices:
    """Return the settings of a model: the sections of a candidate, and the settings of the study
    that no candidate changes.
    """
    fused = {key.removeprefix("fuse."): v for key, v in sections.items() if key.startswith("fuse.")}
    return _CHOICES.validate_python(
        {
            **EMPTY,
            **sections,
            "levels": part.levels,
            "lengths": part.lengths,
            "name": "search",
            "fuse": replace(part.fuse, **fused),
        }
    )


WHOLE = 0.5
"""Smallest fraction of the left-out samples that a structure must predict, because structures with
long lags say nothing about short recordings.
"""


def tried_ways(candidate: Tried, bench: Bench) -> list[Outcome]:
    """Fit a structure, and return its outcomes: one for each way in which the model can continue
    outside the range of a curve (`continuations`). The outcome of the candidate itself comes first.

    If the study sets the extrapolation, the candidate is tried only in this way. A continuation is
    left out if its errors equal those of an earlier continuation at every sample.
    """
    choices = choices_of(candidate.sections, bench.part)
    model, whole = refit_near(choices, bench.dataset, None)
    has_ends = isinstance(model.body, Pieces) and model.body.backbone is None
    fixed = bench.part.fuse.extrapolation is not None or candidate.family in SHOWN
    ways = [
        replace(way, failure=_refusal(_going_on(model, way), bench))
        for way in (continuations(candidate) if has_ends and not fixed else [candidate])
    ]
    accepted = [way for way in ways if not way.failure]
    if not accepted:
        return [(ways[0], ())]
    rests = [without(bench.dataset, masks) for masks in bench.masks]
    remade = [refit_near(choices, rest, whole)[0] for rest in rests]
    outcomes = dict[bytes, Outcome]()
    for way in accepted:
        errors = [
            _errors(_going_on(fold_model, way), rest, masks)
            for fold_model, rest, masks in zip(remade, rests, bench.masks, strict=True)
        ]
        if np.isnan(np.concatenate(errors[: bench.blocks] or errors)).mean() > 1 - WHOLE:
            failure = "needs a longer past than most left-out samples have"
            return [(replace(way, failure=failure), ())]
        every = np.concatenate(errors).tobytes()
        outcomes.setdefault(every, (replace(way, parameters=parameters(model)), errors))
    return [*outcomes.values()]


def _going_on(model: Model, way: Tried) -> Model:
    """Return a copy of a model. Outside the range of its curves, it behaves as `way` says."""
    body = model.body
    if BEYOND not in way.sections or not isinstance(body, Pieces):
        return model
    sides = dict.fromkeys(body.fusion.extrapolation, (way.sections[BEYOND],) * 2)
    return replace(model, body=body.joined(extrapolation=sides))


def _errors(model: Model, rest: Dataset, masks: Sequence[BoolArray]) -> Array:
    """Return the errors of a model on the samples that a fold leaves out of every curve, (n,). The
    error is NaN if a sample has too few earlier samples for a prediction, and infinite after the
    prediction has diverged.
    """
    errors = [
        np.where(
            predicted.ready & ~np.isfinite(predicted.values),
            np.inf,
            predicted.values - curve.columns[rest.target],
        )[out]
        for curve, out, predicted in missed_by(model, rest, masks)
    ]
    return np.concatenate(errors)


SWING = 0.1
"""Fraction of the output's range by which the start of a second test run is higher than that of the
first. Also the largest standard deviation of the difference of both runs in their second half, as a
fraction of the largest difference.
"""

LARGER = 1.2
"""Factor by which the deviations of the inputs from their middle are multiplied in a test run, in
which a model that feeds its output back must still be stable. With the recorded inputs, an unstable
model may seem stable, because whoever recorded them kept the output in its range.
"""


def _refusal(model: Model, bench: Bench) -> str:
    """Return the reason why a model is refused whatever its errors are; empty if it is accepted.

    If the inputs repeat, a model with poles on the unit circle can oscillate in time with them, and
    predict the recording well without depending on the inputs. Therefore, a model that feeds its
    output back is refused if the start of a free run still makes it oscillate late in the longest
    recording. Two free runs are compared: the first starts at the measured output, the second
    higher by a tenth of the range. An integrator is not refused, because it keeps its offset and
    does not oscillate.
    """
    longest = max(bench.dataset.curves, key=attrgetter("size"))
    target, columns = bench.dataset.target, longest.columns
    if fed_back(model):
        higher = {target: columns[target] + SWING * np.ptp(bench.range)}
        apart = _run(model, longest, higher) - _run(model, longest, {})
        late = apart[longest.size // 2 :]
        if np.isfinite(late).any() and np.nanstd(late) > SWING * np.nanmax(np.abs(apart)):
            return (
                "oscillates by itself: the transient of its start is still visible late in a "
                "recording"
            )
        larger = {
            name: middle + LARGER * (columns[name] - middle)
            for name in bench.situation.inputs
            for middle in (np.mean(extremes(columns[name])),)
        }
        if _astray(_run(model, longest, larger), bench):
            return f"runs away from all measured values if its inputs are {LARGER:g} times as large"
    if not (bench.situation.timed and runs_over_time(model)) and any(
        _astray(_run(model, curve, {}), bench) for curve in bench.study.curves
    ):
        return "diverges at inputs of the study, far beyond all measured values"
    if exploding_curves(model, bench.dataset.curves, target):
        return "diverges beyond the ends of its curves"
    return ""


def _run(model: Model, curve: Curve, changed: Columns) -> Array:
    """Return the predictions of a model along a curve with other values in some columns, (n,)."""
    return forecast(model, replace(curve, columns={**curve.columns, **changed})).values


def _astray(values: Array, bench: Bench) -> bool:
    """Return True if any of the predictions, (n,), lies outside the range of reasonable outputs
    (`bench.range`) by more than the width of this range.

    A steep formula may pass through all training samples, including those that were left out, and
    explode in a gap between them.
    """
    return bool((np.abs(values - np.mean(bench.range)) > 1.5 * np.ptp(bench.range)).any())
