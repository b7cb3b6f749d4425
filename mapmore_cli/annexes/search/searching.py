"""Implement `model: {type: auto}`: structures are compared on training data, one is chosen, and its
spec is made.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.resources import files
from itertools import chain
from math import comb
from operator import call
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from pydantic import TypeAdapter

from mapmore_cli.annexes.search.bench import Bench, Slice, searchable
from mapmore_cli.annexes.search.black_boxes import BLACK_BOX, Left, Outcome, black_boxes
from mapmore_cli.annexes.search.candidate import (
    MOST_PARAMETERS,
    SHARE,
    Structure,
    offered_structures,
)
from mapmore_cli.annexes.search.further import go_on, lacking, note_of
from mapmore_cli.annexes.search.situation import situation_of
from mapmore_cli.domain import plugins
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError, FitError, MapmoreError
from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Search, Tried
from mapmore_cli.fitting.kinds import refit_near
from mapmore_cli.fitting.kinds.choices import ModelChoices, lengths_of
from mapmore_cli.fitting.refitting import missed_by, without
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.kinds import fed_back, parameters, runs_over_time
from mapmore_cli.modelling.memory.records import sampled
from mapmore_cli.modelling.pieces.remarks import exploding_curves
from mapmore_cli.modelling.validation.significance import WITHIN, simplest_of, undominated
from mapmore_cli.pipeline.processors import free_processors, shared_out

if TYPE_CHECKING:
    from mapmore_cli.fitting.stage import Progress

FAMILIES = ("tables", "states", "friction", "feedback")
"""Files of candidates in the order in which they are tried. If time is short, the last ones are
left out.
"""

BEYOND = "fuse.extrapolation"
"""Setting for the behaviour of pieces outside the range of each curve."""

WHOLE = 0.5
"""Smallest share of the left-out samples that a structure must predict; long lags say nothing about
short recordings.
"""

BY_MEAN = (
    "the fewest parameters of those within one standard error of the best (2 to 20 %), a "
    "plain model within 2 %"
)
BY_MEDIAN = (
    "the least median error, 5 % of the logarithm of the number of parameters added, or a "
    "plain model within 2 % of it"
)

BY_ENDS = "; an end is held out, so that the folds that leave an end out decide alone"

PLAIN = ("simple", "formula")
"""Kinds that are preferred if they are as good as any other."""

SHOWN = (BLACK_BOX, "papers")
"""Kinds that are shown in the table but never chosen."""


@cache
def family(name: str) -> Mapping[str, Any]:
    """Return the contents of a file of candidates (`annexes/search/NAME.yaml`)."""
    text = (
        files("mapmore_cli.annexes.search")
        .joinpath(f"families/{name}.yaml")
        .read_text(encoding="utf-8")
    )
    document: Mapping[str, Any] = yaml.safe_load(text)
    return document


def search(
    dataset: Dataset,
    part: Slice,
    progress: Progress = lambda _what, _done, _total: None,
    *,
    beside: bool = True,
) -> Search:
    """Try every candidate on training samples that are left out, and choose one.

    Held-out outputs are dropped before anything is computed. With `beside`, black boxes are
    compared on the same folds; if one of them has a clearly smaller error, longer structures are
    tried as well (`further`).

    Raises
    ------
    FitError
        If no structure could be fitted.
    """
    training = searchable(dataset)
    situation = situation_of(training, part.ignored, part.model.inputs)
    uneven = _uneven(dataset) if situation.timed else ()
    # a model that counts steps along recordings could not be fitted in these cases
    if part.by_level or uneven:
        situation = replace(situation, step=None)
    situation = replace(situation, ordered=part.in_order(dataset) and not situation.timed)
    parts = plugins.parts("families", Mapping)  # type: ignore[type-abstract]
    added = [part.value for part in parts]
    families = [*map(family, FAMILIES), *added]
    bench = Bench.of(training, situation, part, dataset)
    boxes = [partial(black_boxes, bench.dataset, bench.folds, situation)] if beside else []
    budget = Budget(part.model.budget)
    try_all = partial(_try_all, bench, budget, partial(progress, "structures"))
    outcomes = try_all(families, boxes)
    most = None if situation.timed else max(MOST_PARAMETERS, comb(len(situation.inputs) + 3, 3))
    result = _choose_structure(outcomes, bench, most)
    if part.model.prefer is None:
        more = None if most is None else max(most, situation.samples // SHARE)
        result = go_on(
            result,
            bench,
            lambda name: try_all([family(name)]),
            lambda later: _choose_structure([*outcomes, *later], bench, more),
        )
    ended = (
        f"the budget of {budget.seconds:g} s ended before {budget.cut} of {budget.listed} "
        "structures were tried"
    )
    notes = (*[ended] * bool(budget.cut), *uneven, *_notes_of(result, bench))
    return replace(result, cut=budget.cut, notes=notes)


def _uneven(dataset: Dataset) -> tuple[str, ...]:
    """Return the reasons why a model with memory could not be fitted to the recordings, for example
    uneven time steps; held-out parts are examined too.
    """
    try:
        sampled(dataset.curves)
    except DataError as fault:
        return (f"models with a past were not tried: {fault.message}; {fault.remedy}",)
    return ()


@dataclass
class Budget:
    """Budget of a search: seconds of processor time for structures in each process, so that a busy
    machine tries the same structures as an idle one; and how many structures were listed and cut.
    """

    seconds: float
    worked: float = 0.0
    listed: int = 0
    cut: int = 0

    @property
    def over(self) -> bool:
        """Return True if this process has used up its time."""
        return self.worked > self.seconds


Work = Callable[[], list[Outcome]]


def _try_all(
    bench: Bench,
    budget: Budget,
    progress: Callable[[int, int], None],
    families: Sequence[Mapping[str, Any]],
    boxes: Sequence[Work] = (),
) -> list[Outcome]:
    """Try the structures that families offer, and the black boxes."""
    before = budget.worked
    offered = [offered_structures(known, bench.situation) for known in families]
    jobs: list[Work] = [partial(_try_structure, one, bench, budget) for one in chain(*offered)]
    done = shared_out(call, [*jobs, *boxes], progress)
    outcomes = [*chain(*done)]
    budget.listed += len(jobs)
    budget.cut += done[: len(jobs)].count([])
    # forks of this process have done work that its own clock does not include
    budget.worked = before + sum(one.seconds for one, _ in outcomes) / free_processors()
    return outcomes


def _choose_structure(outcomes: Sequence[Outcome], bench: Bench, most: int | None) -> Search:
    """Score all structures and black boxes on the rows that all of them predict, and choose one
    structure.
    """
    tried = [one for one, _ in outcomes]
    usable = [number for number, one in enumerate(tried) if not one.failure]
    sizes = np.array([tried[number].parameters for number in usable])
    kinds = [tried[number].family for number in usable]
    eligible = ~np.isin(kinds, SHOWN) & (True if most is None else sizes <= most)
    if not eligible.any():
        reasons = next((one.failure for one in tried if one.failure), "there was no time for any")
        raise FitError(
            f"no structure could be fitted with a part of the data left out: {reasons}",
            "name one, or raise `model.budget`",
        )
    target = bench.dataset.target
    measured = [curve.columns[target][curve.training] for curve in bench.dataset.curves]
    scale = float(np.ptp(np.concatenate(measured))) or 1.0
    errors = _on_common_rows([outcomes[number][1] for number in usable]) / scale
    decide = bench.weights > 0
    weights = bench.weights[decide]
    rank = simplest_of(sizes.tolist(), errors[:, decide], weights, eligible, median=most is None)
    front = undominated(sizes, np.where(eligible, rank.excess, np.inf))
    as_good = front & (rank.excess <= WITHIN[0]) & (sizes <= sizes[rank.chosen])
    simple = np.flatnonzero(as_good & np.isin(kinds, PLAIN)).tolist()
    chosen = min(simple, key=lambda i: (sizes[i], rank.excess[i]), default=rank.chosen)
    for place, number in enumerate(usable):
        blocks, parts = (
            float(np.sqrt(np.mean(of**2))) if of.size else np.nan
            for of in np.split(errors[place], [bench.blocks])
        )
        tried[number] = replace(
            tried[number],
            errors=tuple(errors[place].tolist()),
            error=blocks,
            parts=parts,
            excess=float(rank.excess[place]),
            spread=float(rank.spread[place]),
        )
    return Search(
        "search",
        target,
        bench.left_out,
        bench.parts_left_out,
        scale,
        tuple(tried),
        usable[rank.best],
        usable[chosen],
        f"{BY_MEDIAN if most is None else BY_MEAN}{BY_ENDS * bench.ends}",
    )


def _notes_of(result: Search, bench: Bench) -> list[str]:
    """Return notes for the reader of the table: that more parameters add nothing, or that a black
    box is clearly better.
    """
    own, best, notes = result.found, result.tried[result.best], list[str]()
    if own.family in PLAIN and result.chosen != result.best:
        notes.append(
            f"{own.words} is as good as structures with more parameters: {best.words} adds "
            "nothing that left-out data show"
        )
    if result.short is not None:
        notes.append(note_of(result, result.short))
    if lack := lacking(result, bench):
        where = bench.parts_left_out.rpartition(" ")[2] if bench.asks_parts else "stretches"
        notes.append(
            f"{lack[0]} has an error {lack[1]:.2g} times smaller on "
            f"left-out {where}: the chosen structure lacks something"
        )
    return notes


def _on_common_rows(predicted: Sequence[Sequence[Left]]) -> Array:
    """Return the RMSE of every structure on every fold, on the rows that all structures predict,
    (s, f); infinite for a run that diverged.
    """
    rmse = []
    for fold in zip(*predicted, strict=True):
        common = np.logical_and.reduce([ready for _, ready in fold])
        squares = np.array([missed[common] for missed, _ in fold]) ** 2
        rmse.append(np.sqrt(np.sum(squares, axis=1) / max(common.sum(), 1)))
    return np.asarray(np.nan_to_num(np.column_stack(rmse), nan=np.inf, posinf=np.inf))


WAYS = {
    "saturate": ", held",
    "continue": ", continued",
    "continue_linear": ", going on straight",
}
"""Behaviours of pieces outside the range of each curve, and the words that they add to the name of
a structure. Nothing is added for the behaviour that the file of candidates gives, or for holding
the value at the end if it gives none.
"""


def _try_structure(candidate: Structure, bench: Bench, budget: Budget) -> list[Outcome]:
    """Fit a structure to all samples and, if that succeeds, again without each fold; return nothing
    if the time is used up.
    """
    if budget.over:
        return []
    started = time.process_time()
    try:
        outcomes = _tried_ways(candidate, bench)
    except MapmoreError as fault:
        outcomes = [_outcome(candidate, None, failure=fault.message)]
    seconds = time.process_time() - started
    budget.worked += seconds
    each = round(seconds / len(outcomes), 2)
    return [(replace(one, seconds=each), left) for one, left in outcomes]


def _tried_ways(candidate: Structure, bench: Bench) -> list[Outcome]:
    """Return a structure with each of the `WAYS` to continue outside the range of a curve, its own
    way first, unless the study names one. A way with the same errors as an earlier one on every
    sample is left out.
    """
    choices = choices_of(candidate.sections, bench.part)
    model, whole = refit_near(choices, bench.dataset, None)
    open_ = isinstance(model.body, Pieces) and model.body.backbone is None
    named = bench.part.fuse.extrapolation is not None or candidate.kind in SHOWN
    own = candidate.sections.get(BEYOND, "saturate")
    ways = tuple(dict.fromkeys((own, *WAYS))) if open_ and not named else (None,)
    refused = {way: _refusal(_going_on(model, way), bench) for way in ways}
    left: dict[str | None, list[Left]] = {way: [] for way in ways if not refused[way]}
    if not left:
        return [_outcome(candidate, ways[0], failure=refused[ways[0]])]
    for masks in bench.masks:
        rest = without(bench.dataset, masks)
        remade, _ = refit_near(choices, rest, whole)
        for way, missed in left.items():
            missed.append(_errors(_going_on(remade, way), rest, masks))
    outcomes = list[Outcome]()
    for way, missed in left.items():
        if any(_are_equal(missed, other) for _, other in outcomes):
            continue
        asked = missed[: bench.blocks] or missed
        if np.concatenate([ready for _, ready in asked]).mean() < WHOLE:
            failure = "needs a longer past than most left-out samples have"
            return [_outcome(candidate, way, failure=failure)]
        outcomes.append(_outcome(candidate, way, parameters(model), missed))
    return outcomes


def _are_equal(some: Sequence[Left], others: Sequence[Left]) -> bool:
    pairs = zip(some, others, strict=True)
    return all(np.array_equal(a, b, equal_nan=True) for (a, _), (b, _) in pairs)


def _outcome(
    candidate: Structure,
    way: str | None,
    size: int = 0,
    left: Sequence[Left] = (),
    failure: str = "",
) -> Outcome:
    own = candidate.sections.get(BEYOND, "saturate")
    sections = {**candidate.sections, **({} if way is None else {BEYOND: way})}
    words = candidate.words + ("" if way in (None, own) else WAYS[way])
    return Tried(candidate.kind, words, sections, size, failure=failure), left


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
"""Limits of the test for ringing. A run is started higher by the first fraction of the range; in
its second half, the difference may still oscillate by the second fraction of its largest value.
"""


def _refusal(model: Model, bench: Bench) -> str:
    """Return the reason why a model is refused whatever its errors are; empty if it is accepted."""
    if fed_back(model) and rings(model, bench.dataset):
        return (
            "oscillates by itself: the transient of its start is still visible late in a recording"
        )
    if not (bench.situation.timed and runs_over_time(model)) and astray(model, bench):
        return "diverges at inputs of the study, far beyond all measured values"
    if exploding_curves(model, bench.dataset.curves, bench.dataset.target):
        return "diverges beyond the ends of its curves"
    return ""


def rings(model: Model, dataset: Dataset) -> bool:
    """Return True if a free run that starts a tenth of the range higher still oscillates around the
    measured one late in the longest recording.

    If inputs repeat, a model with poles on the unit circle continues the record like a clock,
    whatever drives it. An integrator keeps its offset and does not oscillate.
    """
    curve = max(dataset.curves, key=lambda one: one.size)
    output = curve.columns[dataset.target]
    shifted = output + SWING * (np.nanmax(output) - np.nanmin(output))
    higher = replace(curve, columns={**curve.columns, dataset.target: shifted})
    apart = forecast(model, higher).values - forecast(model, curve).values
    late = apart[curve.size // 2 :]
    swings = np.isfinite(late).any() and np.nanstd(late) > SWING * np.nanmax(np.abs(apart))
    return bool(swings)


def astray(model: Model, bench: Bench) -> bool:
    """Return True if a model without a past deviates from the measured values, and from the
    prediction of a plane, by more than their range, at any inputs of the study.

    A steep formula may pass through all training samples, including those that were left out, and
    explode in a gap between them.
    """
    low, high = bench.range
    values = np.concatenate([forecast(model, curve).values for curve in bench.study.curves])
    return bool((np.abs(values - (low + high) / 2) > 1.5 * (high - low)).any())


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


def settings_of(result: Search) -> dict[str, Any]:
    """Return the sections that were found, as settings on top of the spec."""
    return {**EMPTY, **result.found.sections}


def formulas_beside(result: Search, every: bool = False) -> list[str]:
    """Return the formula of the literature with the smallest error of those tried; none if it is
    the chosen structure. With `every`, return all formulas, so that they are not selected by their
    errors.
    """
    formulas = [one for one in result.tried if one.family == "formula" and not one.failure]
    if not every:
        formulas = sorted(formulas, key=lambda one: one.excess)[:1]
        formulas = [one for one in formulas if one is not result.found]
    return [str(one.sections["model"]["name"]) for one in formulas]
