"""Try a structure: fit it to all training samples and without each fold, and refuse it if it
diverges.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from mapmore_cli.annexes.search.bench import Bench, Slice
from mapmore_cli.annexes.search.black_boxes import SHOWN, Left, Outcome
from mapmore_cli.annexes.search.candidate import WAYS, going_on, way_of
from mapmore_cli.domain.arrays import BoolArray, extremes
from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import Tried
from mapmore_cli.fitting.kinds import refit_near
from mapmore_cli.fitting.kinds.choices import ModelChoices, lengths_of
from mapmore_cli.fitting.refitting import missed_by, without
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.kinds import fed_back, parameters, runs_over_time
from mapmore_cli.modelling.pieces.remarks import exploding_curves

_CHOICES = TypeAdapter(ModelChoices)

EMPTY: Mapping[str, Any] = {
    "segment": {},
    "dictionary": [],
    "model": {"type": "mapmore"},
    "fit": {},
}
"""Sections that define a structure, with their values if the structure does not set them."""


def choices_of(sections: Mapping[str, Any], part: Slice) -> ModelChoices:
    """Return the sections of a candidate in the form of the spec."""
    fused = {key.removeprefix("fuse."): v for key, v in sections.items() if key.startswith("fuse.")}
    choices = _CHOICES.validate_python(
        {
            **{key: sections.get(key, empty) for key, empty in EMPTY.items()},
            "levels": part.levels,
            "lengths": {},
            "name": "search",
            "fuse": replace(part.fuse, **fused),
        }
    )
    return replace(choices, lengths=lengths_of(choices.model, part.lengths))


WHOLE = 0.5
"""Smallest fraction of the left-out samples that a structure must predict, because structures with
long lags say nothing about short recordings.
"""


def tried_ways(candidate: Tried, bench: Bench) -> list[Outcome]:
    """Fit a structure, and return it once for each of the `WAYS` in which its pieces can continue
    outside the range of a curve. The way that the candidate itself sets comes first. If the study
    sets the extrapolation, only this is tried. A way with the same errors as an earlier one on
    every sample is left out.
    """
    choices = choices_of(candidate.sections, bench.part)
    model, whole = refit_near(choices, bench.dataset, None)
    has_ends = isinstance(model.body, Pieces) and model.body.backbone is None
    fixed = bench.part.fuse.extrapolation is not None or candidate.family in SHOWN
    ways = tuple(dict.fromkeys((way_of(candidate), *WAYS))) if has_ends and not fixed else (None,)
    refused = {way: _refusal(_going_on(model, way), bench) for way in ways}
    left: dict[str | None, list[Left]] = {way: [] for way in ways if not refused[way]}
    if not left:
        return [(replace(going_on(candidate, ways[0]), failure=refused[ways[0]]), ())]
    for masks in bench.masks:
        rest = without(bench.dataset, masks)
        remade, _ = refit_near(choices, rest, whole)
        for way, missed in left.items():
            missed.append(_errors(_going_on(remade, way), rest, masks))
    outcomes = list[Outcome]()
    for way, missed in left.items():
        if any(_are_equal(missed, other) for _, other in outcomes):
            continue
        named, asked = going_on(candidate, way), missed[: bench.blocks] or missed
        if np.concatenate([ready for _, ready in asked]).mean() < WHOLE:
            failure = "needs a longer past than most left-out samples have"
            return [(replace(named, failure=failure), ())]
        outcomes.append((replace(named, parameters=parameters(model)), missed))
    return outcomes


def _are_equal(some: Sequence[Left], others: Sequence[Left]) -> bool:
    pairs = zip(some, others, strict=True)
    return all(np.array_equal(missed, other, equal_nan=True) for (missed, _), (other, _) in pairs)


def _going_on(model: Model, way: str | None) -> Model:
    """Return a model that continues in another way outside the range of its curves."""
    body = model.body
    if way is None or not isinstance(body, Pieces):
        return model
    extrapolation = dict.fromkeys(body.fusion.extrapolation, (way, way))
    return replace(model, body=body.joined(extrapolation=extrapolation))


def _errors(model: Model, rest: Dataset, masks: Sequence[BoolArray]) -> Left:
    """Return the errors on the samples that a fold leaves out of every curve, (n,), and a mask of
    the samples that the model predicts.
    """
    every = missed_by(model, rest, masks)
    missed = [
        predicted.values[out] - curve.columns[rest.target][out] for curve, out, predicted in every
    ]
    return np.concatenate(missed), np.concatenate(
        [predicted.ready[out] for _, out, predicted in every]
    )


SWING = 0.1
"""Fraction of the output's range by which the start of a test run is raised; and fraction of the
largest resulting difference that may still oscillate in the second half of the run.
"""


def _refusal(model: Model, bench: Bench) -> str:
    """Return the reason why a model is refused whatever its errors are; empty if it is accepted."""
    if fed_back(model):
        longest = max(bench.dataset.curves, key=attrgetter("size"))
        if rings(model, longest, bench):
            return (
                "oscillates by itself: the transient of its start is still visible late in a "
                "recording"
            )
        if astray(model, [with_larger_inputs(longest, bench.situation.inputs)], bench):
            return f"runs away from all measured values if its inputs are {LARGER:g} times as large"
    if not (bench.situation.timed and runs_over_time(model)) and astray(
        model, bench.study.curves, bench
    ):
        return "diverges at inputs of the study, far beyond all measured values"
    if exploding_curves(model, bench.dataset.curves, bench.dataset.target):
        return "diverges beyond the ends of its curves"
    return ""


def rings(model: Model, curve: Curve, bench: Bench) -> bool:
    """Return True if the start of a free run still makes it oscillate late in a recording. Two free
    runs are compared: one starts at the measured output, the other a tenth of the range higher.

    If inputs repeat, a model with poles on the unit circle continues the record like a clock,
    whatever drives it. An integrator keeps its offset and does not oscillate.
    """
    higher = curve.columns[bench.dataset.target] + SWING * np.ptp(bench.range)
    started_higher = replace(curve, columns={**curve.columns, bench.dataset.target: higher})
    apart = forecast(model, started_higher).values - forecast(model, curve).values
    late = apart[curve.size // 2 :]
    return bool(np.isfinite(late).any() and np.nanstd(late) > SWING * np.nanmax(np.abs(apart)))


LARGER = 1.2
"""Factor of the inputs, about their middle, with which a fed-back model must still be stable. With
the inputs as they were, an unstable model may seem stable, because whoever recorded them kept the
output in its range.
"""


def with_larger_inputs(curve: Curve, names: Sequence[str]) -> Curve:
    """Return a curve whose inputs are `LARGER` times as far from the middle of their range."""
    columns = dict(curve.columns)
    for name in names:
        middle = np.mean(extremes(columns[name]))
        columns[name] = middle + LARGER * (columns[name] - middle)
    return replace(curve, columns=columns)


def astray(model: Model, curves: Sequence[Curve], bench: Bench) -> bool:
    """Return True if the prediction at any sample of the curves lies outside the range of
    reasonable outputs (`bench.range`) by more than the width of this range.

    A steep formula may pass through all training samples, including those that were left out, and
    explode in a gap between them.
    """
    values = np.concatenate([forecast(model, curve).values for curve in curves])
    return bool((np.abs(values - np.mean(bench.range)) > 1.5 * np.ptp(bench.range)).any())
