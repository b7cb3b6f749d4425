"""`model: {type: auto}`: structures tried on training data alone, the one that is taken, and the
spec that it makes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.resources import files
from math import comb
from operator import attrgetter, call
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from pydantic import TypeAdapter

from mapmore_cli.annexes.search.bench import (
    Bench,
    Slice,
    cut_short,
    held_run,
    searchable,
)
from mapmore_cli.annexes.search.black_boxes import Left, black_boxes
from mapmore_cli.annexes.search.candidate import Structure, offered_structures
from mapmore_cli.annexes.search.situation import situation_of
from mapmore_cli.domain import plugins
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError, FitError, MapmoreError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.processors import shared_out
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Search, Tried
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.fitting.kinds.choices import ModelChoices, lengths_of
from mapmore_cli.fitting.refitting import left_out_of
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.kinds import fed_back, parameters, runs_over_time
from mapmore_cli.modelling.memory.records import records_of, time_step
from mapmore_cli.modelling.validation.significance import WITHIN, simplest_of

if TYPE_CHECKING:
    from mapmore_cli.fitting.stage import Progress

FAMILIES = ("tables", "states", "friction", "feedback")
"""Files of candidates in the order in which they are tried: where time is short, the last ones are
left out.
"""

MOST_PARAMETERS = 28
"""Of a structure that is taken for a table, or as many as the cubic of all inputs has; what has
more is only shown.
"""

LESS = 0.9
"""Times the error of the structure that was found, below which a black box errs clearly less."""

WHOLE = 0.5
"""Share of the left-out samples that a structure predicts at least: long lags say nothing of short
recordings.
"""

BY_MEAN = (
    "the fewest parameters of those within one standard error of the best (2 to 20 %), a "
    "plain model within 2 %"
)
BY_MEDIAN = (
    "the least median error, 5 % of the logarithm of the number of parameters added, or a "
    "plain model within 2 % of it"
)

PLAIN, BLACK_BOX = ("simple", "formula"), "black box"
"""Kinds that are found where they are as good as anything, and one of those that are never found.
"""

SHOWN = (BLACK_BOX, "papers")
"""Kinds that stand in the table and are not taken."""


@cache
def family(name: str) -> Mapping[str, Any]:
    """Return a file of candidates."""
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
    """Try every candidate on left-out training samples, and choose.

    Held-out outputs are dropped before anything is computed. With `beside`, black boxes are tried
    on the same folds.

    Raises
    ------
    FitError
        Where no structure could be fitted.
    """
    training = searchable(dataset)
    situation = situation_of(training, part.ignored, part.model.inputs)
    uneven = _uneven(dataset) if situation.timed else ()
    if part.by_level or uneven:  # a model that runs along recordings cannot be fitted then
        situation = replace(situation, step=None)
    training = cut_short(training, held_run(dataset), situation.timed)
    added = [part.value for part in plugins.parts("families", Mapping)]
    families = [*map(family, FAMILIES), *added]
    listed = [one for known in families for one in offered_structures(known, situation)]
    bench = Bench.of(training, situation, part, dataset)
    budget = Budget(part.model.budget)
    jobs: list[Callable[[], Any]] = [partial(_try_structure, one, bench, budget) for one in listed]
    jobs.append(partial(black_boxes, training, bench.folds, situation) if beside else dict)
    *done, boxes = shared_out(call, jobs, partial(progress, "structures"))
    outcomes: list[Outcome] = [one for one in done if one is not None]
    cut = len(listed) - len(outcomes)
    ended = (
        f"the budget of {part.model.budget:g} s ended before {cut} of {len(listed)} structures "
        "were tried"
    )
    outcomes += [
        (Tried(BLACK_BOX, name.replace("_", " "), {}), left) for name, left in boxes.items()
    ]
    most = None if situation.timed else max(MOST_PARAMETERS, comb(len(situation.inputs) + 3, 3))
    result = _choose_structure(outcomes, bench, most)
    notes = (*[ended] * bool(cut), *uneven, *_notes_of(result, bench))
    return replace(result, cut=cut, notes=notes)


def _uneven(dataset: Dataset) -> tuple[str, ...]:
    """Return what the fit of a model with memory would refuse in the recordings, held-out parts
    included.
    """
    try:
        records_of(dataset.curves, time_step(dataset.curves))
    except DataError as fault:
        return (f"models with a past were not tried: {fault.message}; {fault.remedy}",)
    return ()


@dataclass
class Budget:
    """The budget of a search: seconds of work on structures in each process, so that a busy machine
    tries what an idle one does.
    """

    seconds: float
    worked: float = 0.0

    @property
    def over(self) -> bool:
        """Whether this process has worked for longer."""
        return self.worked > self.seconds


Outcome = tuple[Tried, Sequence[Left]]
"""A structure with its left-out errors in every fold."""


def _choose_structure(outcomes: Sequence[Outcome], bench: Bench, most: int | None) -> Search:
    """Score all structures and black boxes on the rows that all of them predict, and take one
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
            f"no structure could be fitted without some of the data: {reasons}",
            "name one, or raise `model.budget`",
        )
    target = bench.dataset.target
    measured = [curve.columns[target][curve.training] for curve in bench.dataset.curves]
    scale = float(np.ptp(np.concatenate(measured))) or 1.0
    errors = _on_common_rows([outcomes[number][1] for number in usable]) / scale
    rank = simplest_of(sizes.tolist(), errors, bench.weights, eligible, median=most is None)
    as_good = eligible & (rank.excess <= WITHIN[0]) & (sizes <= sizes[rank.chosen])
    plain = np.flatnonzero(as_good & np.isin(kinds, PLAIN)).tolist()
    chosen = min(plain, key=lambda i: (sizes[i], rank.excess[i]), default=rank.chosen)
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
        BY_MEDIAN if most is None else BY_MEAN,
    )


def _notes_of(result: Search, bench: Bench) -> list[str]:
    """Return what a reader is told of the table: that more adds nothing, or that a black box errs
    clearly less.
    """
    own, best, notes = result.found, result.tried[result.best], list[str]()
    if own.family in PLAIN and result.chosen != result.best:
        notes.append(
            f"{own.words} is as good as structures with more parameters: {best.words} adds "
            "nothing that left-out data show"
        )
    boxes = [one for one in result.tried if one.family == BLACK_BOX]
    asked = attrgetter("parts" if bench.asks_parts else "error")
    where = bench.parts_left_out.rpartition(" ")[2] if bench.asks_parts else "stretches"
    least = min(boxes, key=asked, default=own)
    if asked(least) < LESS * asked(own):
        notes.append(
            f"{least.words} errs {asked(own) / asked(least):.2g} times less on left-out {where}: "
            "the structure lacks something"
        )
    return notes


def _on_common_rows(predicted: Sequence[Sequence[Left]]) -> Array:
    """RMSE of every structure on every fold, on the rows that all structures predict, (s, f);
    infinite where a run diverged.
    """
    rmse = []
    for fold in zip(*predicted, strict=True):
        common = np.logical_and.reduce([ready for _, ready in fold])
        squares = np.array([missed[common] for missed, _ in fold]) ** 2
        rmse.append(np.sqrt(np.sum(squares, axis=1) / max(common.sum(), 1)))
    return np.asarray(np.nan_to_num(np.column_stack(rmse), nan=np.inf, posinf=np.inf))


def _try_structure(candidate: Structure, bench: Bench, budget: Budget) -> Outcome | None:
    """Fit a structure to all samples, and where that will do without each fold; None where the time
    is over.
    """
    if budget.over:
        return None
    started, left = time.process_time(), list[Left]()
    try:
        choices = choices_of(candidate.sections, bench.part)
        model = refit(choices, bench.dataset)
        failure = _refusal(model, bench)
        if not failure:
            left = [_errors(choices, bench, masks) for masks in bench.masks]
            asked = left[: bench.blocks] or left
            if np.concatenate([ready for _, ready in asked]).mean() < WHOLE:
                failure = "needs a longer past than most left-out samples have"
        size = 0 if failure else parameters(model)
    except MapmoreError as fault:
        size, failure = 0, fault.message
    seconds = time.process_time() - started
    budget.worked += seconds
    made = (candidate.kind, candidate.words, candidate.sections, size)
    return Tried(*made, seconds=round(seconds, 2), failure=failure), left


def _errors(choices: ModelChoices, bench: Bench, masks: Sequence[BoolArray]) -> Left:
    """Return the errors on what a fold leaves out of every curve, (n,), and which are known."""
    every = left_out_of(bench.dataset, masks, partial(refit, choices))
    y = bench.dataset.target
    missed = [said.values[out] - curve.columns[y][out] for curve, out, said in every]
    return np.concatenate(missed), np.concatenate([said.ready[out] for _, out, said in every])


SWING = 0.1
"""Of the range, by which a run begins higher; and of the largest difference that makes, what may
still swing in the second half.
"""


def _refusal(model: Model, bench: Bench) -> str:
    """Return why a model is refused whatever its errors are; empty where it is not."""
    if fed_back(model) and rings(model, bench.dataset):
        return "goes on by itself: its start still rings late in a recording"
    if not runs_over_time(model) and astray(model, bench):
        return "goes astray: far beyond all that was measured, at inputs of the study"
    return ""


def rings(model: Model, dataset: Dataset) -> bool:
    """Tell whether a free run that begins a tenth of the range higher still swings about the
    measured one late in the longest recording.

    Where inputs repeat, a model with poles on the unit circle continues the record as a clock does,
    whatever drives it. An integrator keeps its offset, and does not swing.
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
    """Tell whether a model without a past leaves what was measured, and what a plane foretells, by
    more than their range, at any inputs of the study.

    A steep formula may pass through all training samples, left-out ones too, and explode in a gap
    between them.
    """
    low, high = bench.range
    values = np.concatenate([forecast(model, curve).values for curve in bench.study.curves])
    return bool((np.abs(values - (low + high) / 2) > 1.5 * (high - low)).any())


_CHOICES = TypeAdapter(ModelChoices)


def choices_of(sections: Mapping[str, Any], part: Slice) -> ModelChoices:
    """Return the sections of a candidate as the spec would have them."""
    fused = {key.removeprefix("fuse."): v for key, v in sections.items() if key.startswith("fuse.")}
    given = {"segment": {}, "dictionary": [], "model": {}, "fit": {}, **sections}
    choices = _CHOICES.validate_python(
        {
            **{key: given[key] for key in ("segment", "dictionary", "model", "fit")},
            "levels": part.levels,
            "lengths": {},
            "name": "search",
            "fuse": replace(part.fuse, **fused),
        }
    )
    return replace(choices, lengths=lengths_of(choices.model, part.lengths))


def settings_of(result: Search) -> dict[str, Any]:
    """Return the sections that were found, as settings on top of the spec."""
    empty = {"segment": {}, "dictionary": [], "model": {"type": "mapmore"}, "fit": {}}
    return {**empty, **result.found.sections}


def formula_beside(result: Search) -> str | None:
    """Return the formula of the literature that erred least of those tried; None where none was, or
    where it is what was found.
    """
    formulas = [one for one in result.tried if one.family == "formula" and not one.failure]
    best = min(formulas, key=lambda one: one.excess, default=None)
    return None if best is None or best is result.found else str(best.sections["model"]["name"])
