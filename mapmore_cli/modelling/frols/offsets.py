"""Write notes on two faults of a fitted model: an input is so far from zero that its powers cannot
be distinguished, or the model is only a constant.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from mapmore_cli.domain.arrays import blocks_where
from mapmore_cli.domain.fits import SegmentFit
from mapmore_cli.domain.recording import Curve
from mapmore_cli.domain.results import FitResult
from mapmore_cli.modelling.frols.moments import Blocks, standard

# largest ratio of an input's mean to its standard deviation for which there is no note
# The error of a coefficient is about the rounding error times (mean/standard deviation)^2.
FAR = 1e4
PLACED = ("unit_square", "range")
"""Scalings that move the origin to the samples."""


def far_from_zero(pieces: Sequence[SegmentFit], curves: Sequence[Curve]) -> list[str]:
    """Return a note for every input that is far from zero: its mean over the training samples of
    the `curves` is more than 1e4 times its standard deviation. There is a note only if the input
    occurs in several terms, and if its scaling does not subtract an offset.

    The powers of such an input, for example `1e6 + x`, differ by less than their rounding errors,
    so that the selected terms may be wrong.
    """
    terms = {
        term for piece in pieces if piece.scaling.rule not in PLACED for term in piece.candidates
    }
    notes = []
    for name in curves[0].columns:
        if sum(re.search(rf"\b{name}\b", term) is not None for term in terms) < 2:
            continue
        known = standard(_training_values(curves, name))
        mean, spread = known.centre[-1], known.spread[-1]
        if FAR * spread < abs(mean):
            notes.append(
                f"the mean of {name} is {abs(mean) / spread:.2g} times its spread away from "
                f"zero, so that its terms differ only by rounding; subtract {mean:.6g} "
                "(`derive`), or write `fit: {scaling: unit_square}`, or `scaling: range` for a "
                "model with memory"
            )
    return notes


def _training_values(curves: Sequence[Curve], name: str) -> Blocks:
    """Return the training samples of a quantity in row blocks. They are the `y` of the blocks; `P`
    has no columns.
    """
    parts = [(curve.columns[name], curve.training) for curve in curves]
    return lambda: ((x[:, None][:, :0], x) for part in parts for x in blocks_where(*part))


def constant_alone(fit: FitResult) -> list[str]:
    """Return a note if the constant is the only chosen term and the model has no backbone."""
    if fit.backbone is not None or {term for piece in fit.pieces for term in piece.terms} != {"1"}:
        return []
    left = max(piece.selection.sse / piece.selection.yy for piece in fit.pieces)
    return [
        (
            f"the model is the constant only: it explains all but {left:.2g} of the sum of "
            "squares, but none of the variation"
        )
    ]
