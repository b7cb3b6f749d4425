"""Choose one of the structures that were tried. They are compared on the samples for which all of
them give a prediction. The rule for the choice is `BY_MEAN` for tables and `BY_MEDIAN` for
recordings in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.annexes.search.bench import Bench
from mapmore_cli.annexes.search.black_boxes import SHOWN, Outcome
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

FORMULA = "formula"
PLAIN = ("simple", FORMULA)
"""Kinds that are preferred if they are as good as any other."""

WORSE_INSIDE = (
    "its error inside the range is more than 20 % above that of the best polynomial or formula, so "
    "that the single fold at an end says little about it"
)


def choose_structure(outcomes: Sequence[Outcome], bench: Bench, most: float) -> Search:
    """Compute the errors of all structures and black boxes on the samples for which all of them
    give a prediction. Choose a structure with at most `most` parameters.

    If only one fold has a weight, the errors have no standard error, so that a structure may be the
    best by chance. Then the errors on the stretches are examined as well: a structure is refused if
    its mean logarithm of these errors exceeds that of the best plain structure by more than the
    upper limit of `WITHIN`. A formula is never refused in this way, because few parameters are
    enough for it to describe the end of the range.
    """
    tried = [one for one, _ in outcomes]
    usable = [number for number, one in enumerate(tried) if not one.failure]
    sizes = np.array([tried[number].parameters for number in usable])
    kinds = [tried[number].family for number in usable]
    eligible = ~np.isin(kinds, SHOWN) & (sizes <= most)
    if not eligible.any():
        reasons = next((one.failure for one in tried if one.failure), "there was no time for any")
        raise FitError(
            f"no structure could be fitted with a part of the data left out: {reasons}",
            "define the model in the spec, or raise `model.budget`",
        )
    target, over_time, decide = bench.dataset.target, bench.situation.timed, bench.weights > 0
    scale = float(np.ptp(pooled_training(bench.dataset.curves)[target])) or 1.0
    errors = on_common_rows([outcomes[number][1] for number in usable]) / scale
    plain = eligible & np.isin(kinds, PLAIN)
    refused = np.zeros_like(plain)
    if plain.any() and bench.blocks and decide.sum() == 1:
        inside = simplest_of(sizes, errors[:, : bench.blocks], eligible=plain).excess
        refused = eligible & (inside > WITHIN[1]) & ~np.isin(kinds, FORMULA)
    eligible &= ~refused
    rank = simplest_of(sizes, errors[:, decide], bench.weights[decide], eligible, over_time)
    front = undominated(sizes, np.where(eligible, rank.excess, np.inf))
    as_good = plain & front & (rank.excess <= WITHIN[0]) & (sizes <= sizes[rank.chosen])
    chosen = min(
        np.flatnonzero(as_good), key=lambda i: (sizes[i], rank.excess[i]), default=rank.chosen
    )
    for place, number in enumerate(usable):
        blocks, parts = np.split(errors[place], [bench.blocks])
        tried[number] = replace(
            tried[number],
            errors=tuple(errors[place].tolist()),
            error=root_mean_square(blocks) if blocks.size else np.nan,
            parts=root_mean_square(parts) if parts.size else np.nan,
            excess=float(rank.excess[place]),
            spread=float(rank.spread[place]),
            failure=WORSE_INSIDE if refused[place] else "",
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


def on_common_rows(left: Sequence[Sequence[Array]]) -> Array:
    """Return the RMSE of every structure on every fold, (s, f). `left` holds, for each structure,
    its errors on the samples of each fold. Samples at which the error of some structure is NaN,
    because it gives no prediction, are left out for all structures. The RMSE is infinite for a
    structure that diverged.
    """
    rmse = []
    for fold in zip(*left, strict=True):
        errors = np.array(fold)
        squares = np.compress(~np.isnan(errors).any(axis=0), errors, axis=1) ** 2
        rmse.append(np.sqrt(np.sum(squares, axis=1) / max(squares.shape[1], 1)))
    return np.column_stack(rmse)
