"""Choose one of the structures that were tried. They are scored on the rows that all of them
predict. The rule for the choice is `BY_MEAN` for tables and `BY_MEDIAN` for recordings in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.annexes.search.bench import Bench
from mapmore_cli.annexes.search.black_boxes import SHOWN, Left, Outcome
from mapmore_cli.domain.arrays import Array, root_mean_square
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.results import Search
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.validation.significance import WITHIN, simplest_of, undominated

BY_MEAN = (
    "the structure with the fewest parameters among those within one standard error of the best "
    "(2 to 20 %), or a plain model within 2 % of the best"
)
BY_MEDIAN = (
    "the structure with the smallest median error after 5 % of the logarithm of its number of "
    "parameters was added, or a plain model within 2 % of it"
)

PLAIN = ("simple", "formula")
"""Kinds that are preferred if they are as good as any other."""


def choose_structure(outcomes: Sequence[Outcome], bench: Bench, most: int | None) -> Search:
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
            "define the model in the spec, or raise `model.budget`",
        )
    target = bench.dataset.target
    scale = float(np.ptp(pooled_training(bench.dataset.curves)[target])) or 1.0
    errors = on_common_rows([outcomes[number][1] for number in usable]) / scale
    decide, over_time, counts = bench.weights > 0, most is None, sizes.tolist()
    rank = simplest_of(counts, errors[:, decide], bench.weights[decide], eligible, over_time)
    front = undominated(sizes, np.where(eligible, rank.excess, np.inf))
    as_good = front & (rank.excess <= WITHIN[0]) & (sizes <= sizes[rank.chosen])
    simple = np.flatnonzero(as_good & np.isin(kinds, PLAIN)).tolist()
    chosen = min(simple, key=lambda i: (sizes[i], rank.excess[i]), default=rank.chosen)
    for place, number in enumerate(usable):
        blocks, parts = (
            root_mean_square(of) if of.size else np.nan
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
        BY_MEDIAN if over_time else BY_MEAN,
    )


def on_common_rows(predicted: Sequence[Sequence[Left]]) -> Array:
    """Return the RMSE of every structure on every fold, on the rows that all structures predict,
    (s, f); infinite for a run that diverged.
    """
    rmse = []
    for fold in zip(*predicted, strict=True):
        common = np.logical_and.reduce([ready for _, ready in fold])
        squares = np.array([missed[common] for missed, _ in fold]) ** 2
        rmse.append(np.sqrt(np.sum(squares, axis=1) / max(common.sum(), 1)))
    return np.asarray(np.nan_to_num(np.column_stack(rmse), nan=np.inf, posinf=np.inf))
