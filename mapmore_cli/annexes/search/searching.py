"""Implement `model: {type: auto}`: structures are compared on training data, one is chosen, and its
spec is made.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.resources import files
from itertools import chain
from operator import call
from typing import TYPE_CHECKING, Any

import yaml

from mapmore_cli.annexes.search.bench import Bench, Slice
from mapmore_cli.annexes.search.black_boxes import Outcome, black_boxes
from mapmore_cli.annexes.search.candidate import (
    MOST_PARAMETERS,
    SHARE,
    offered_structures,
)
from mapmore_cli.annexes.search.choosing import PLAIN, choose_structure
from mapmore_cli.annexes.search.further import go_on, longer_note, outdone_note
from mapmore_cli.annexes.search.samples import searchable
from mapmore_cli.annexes.search.situation import Situation, situation_of
from mapmore_cli.annexes.search.trying import tried_ways
from mapmore_cli.domain import plugins
from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Search, Tried
from mapmore_cli.modelling.memory.records import sampled
from mapmore_cli.pipeline.processors import free_processors, shared_out

if TYPE_CHECKING:
    from mapmore_cli.fitting.stage import Progress

FAMILIES = ("tables", "states", "friction", "feedback")
"""Files of candidates in the order in which they are tried. If time is short, the last ones are
left out.
"""


@cache
def family(name: str) -> Mapping[str, Any]:
    """Return the contents of a file of candidates (`annexes/search/families/NAME.yaml`)."""
    path = files(__package__).joinpath("families", f"{name}.yaml")
    document: Mapping[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
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
    ordered = part.in_order(dataset)
    uneven = _uneven(dataset) if situation.timed or ordered else ()
    # models with memory cannot be fitted if levels are left out or time steps are uneven
    step = None if part.by_level or uneven else situation.step
    situation = replace(situation, step=step, ordered=ordered and step is None)
    added = plugins.parts("families", Mapping)  # type: ignore[type-abstract]
    families = [*map(family, FAMILIES), *(plugin.value for plugin in added)]
    bench = Bench.of(training, situation, part, dataset)
    boxes = [partial(black_boxes, bench.dataset, bench.folds, situation)] if beside else []
    trials = Trials(bench, partial(progress, "structures"))
    outcomes = trials.outcomes(families, boxes)
    most = most_parameters(situation)
    result = choose_structure(outcomes, bench, most)

    def with_round(name: str) -> Search:
        outcomes.extend(trials.outcomes([family(name)]))
        return choose_structure(outcomes, bench, max(most, situation.samples // SHARE))

    if part.model.prefer is None:
        result = go_on(result, bench, with_round)
    outdone = outdone_note(result, bench)
    ended = (
        f"the budget of {part.model.budget:g} s ended before {trials.cut} of {trials.listed} "
        "structures were tried"
    )
    notes = (
        ended if trials.cut else "",
        *uneven,
        _plain_note(result),
        longer_note(result),
        outdone,
    )
    return replace(result, cut=trials.cut, notes=tuple(filter(None, notes)), outdone=outdone)


def most_parameters(situation: Situation) -> float:
    """Return the largest number of parameters of a structure in the first round: as many as a
    cubic polynomial of all inputs has, but at least `MOST_PARAMETERS`. The number is infinite for
    structures over time.
    """
    return (
        math.inf
        if situation.timed
        else max(MOST_PARAMETERS, math.comb(len(situation.inputs) + 3, 3))
    )


def _uneven(dataset: Dataset) -> tuple[str, ...]:
    """Return the reasons why a model with memory could not be fitted to the recordings, for example
    uneven time steps; held-out parts are examined too.
    """
    try:
        sampled(dataset.curves)
    except DataError as fault:
        return (f"models with memory were not tried: {fault.message}; {fault.remedy}",)
    return ()


Work = Callable[[], list[Outcome]]


@dataclass
class Trials:
    """Trials of structures until the budget of computing time is used up.

    `worked` is the processor time of each process, s. It is used instead of the elapsed time,
    because it hardly depends on other programs on the machine. With faster or more processors, more
    structures are tried. `listed` counts the structures that families offered, and `cut` those that
    were not tried because the budget was used up.
    """

    bench: Bench
    progress: Callable[[int, int], None]
    worked: float = 0.0
    listed: int = 0
    cut: int = 0

    def outcomes(
        self, families: Sequence[Mapping[str, Any]], boxes: Sequence[Work] = ()
    ) -> list[Outcome]:
        """Try the structures that families offer, and the black boxes."""
        before = self.worked
        offered = chain(*(offered_structures(known, self.bench.situation) for known in families))
        jobs: list[Work] = [partial(self.outcomes_of, one) for one in offered]
        done = shared_out(call, [*jobs, *boxes], self.progress)
        outcomes = [*chain(*done)]
        self.listed += len(jobs)
        self.cut += done[: len(jobs)].count([])
        # the clock of this process does not include the work of its child processes
        self.worked = before + sum(one.seconds for one, _ in outcomes) / free_processors()
        return outcomes

    def outcomes_of(self, candidate: Tried) -> list[Outcome]:
        """Fit a structure to all samples and, if that succeeds, again without each fold. Return its
        outcomes, or an empty list if the budget of computing time is used up.
        """
        if self.worked > self.bench.part.model.budget:
            return []
        started = time.process_time()
        try:
            outcomes = tried_ways(candidate, self.bench)
        except MapmoreError as fault:
            outcomes = [(replace(candidate, failure=fault.message), ())]
        seconds = time.process_time() - started
        self.worked += seconds
        each = round(seconds / len(outcomes), 2)
        return [(replace(tried, seconds=each), left) for tried, left in outcomes]


def _plain_note(result: Search) -> str:
    """Return a note that more parameters would add nothing; empty if no plain structure was chosen,
    or if it has the smallest error.
    """
    own, best = result.found, result.tried[result.best]
    note = (
        f"{own.words} is as good as structures with more parameters, because left-out data show no "
        f"advantage of {best.words}"
    )
    return note if own.family in PLAIN and own is not best else ""
