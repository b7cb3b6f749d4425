"""Which oscillator a recording rings with: a grid of frequencies and dampings, by training error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.terms.operator import Setting
from mapmore_cli.modelling.terms.operators import OPERATORS
from mapmore_cli.modelling.terms.recursion import along

FREQUENCIES = tuple(np.geomspace(1.0, 15.0, 30).tolist())
"""Hz: what a load on a soft muscle rings with."""

DAMPINGS = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7)

FASTEST = 0.2
"""Cycles per sample: a faster oscillation is not resolved."""

TIE = 1e-9
"""An oscillator must explain more than another by this fraction to be preferred."""

RANK = 1e-10
"""Relative to the larger, a direction of the oscillator with so little of its own explains nothing."""

CREEP = 0.3
"""Time constant of the slow state that stands for everything else with memory, s."""


def find_resonance(driving: Sequence[Array], output: Sequence[Array], training: Sequence[BoolArray], step: float) -> tuple[float, float]:
    """Frequency (Hz) and damping ratio of the oscillator that leaves least of the training output, the slowest of equals.

    The output is fitted with `[1, x, x^2, s, y, v]`: the driving quantity x, a slow state s of it, the oscillator's position y and
    velocity v.

    Parameters
    ----------
    driving, output
        (n,) for every piece.
    training
        (n,) samples that count.
    """
    frequencies = [f for f in FREQUENCIES if f * step <= FASTEST]
    if not frequencies:
        raise DataError(
            f"no resonance can be seen with {step:g} s between samples: the lowest that is looked for has {FREQUENCIES[0]:g} Hz",
            "give frequency and damping, as resonance(pressure, 0.1, 0.3), or sample faster",
        )
    x = _pooled(driving, training)
    creep = [along(OPERATORS["slow"], one, Setting((CREEP,), step)) for one in driving]
    others = np.column_stack([np.ones(len(x)), x, x**2, _pooled(creep, training)])
    known = np.isfinite(others).all(axis=1)
    basis = np.linalg.qr(others[known])[0]
    y = _pooled(output, training)[known]
    left = y - basis @ (basis.T @ y)
    best = (-np.inf, frequencies[0], DAMPINGS[0])
    for frequency in frequencies:
        for damping in DAMPINGS:
            positions = [along(OPERATORS["resonance"], one, Setting((frequency, damping), step)) for one in driving]
            velocities = [np.nan_to_num(np.diff(one, prepend=one[:1])) for one in positions]  # at rest where they begin
            moved = np.column_stack([_pooled(positions, training), _pooled(velocities, training)])[known]
            gain = _explained(left, moved, basis)
            if gain > best[0] * (1 + TIE):
                best = (gain, frequency, damping)
    return best[1], best[2]


def _explained(left: Array, moved: Array, basis: Array) -> float:
    """By how much columns `moved` reduce the sum of squares of `left`, which is orthogonal to `basis`, beside the basis."""
    along, products = basis.T @ moved, moved.T @ left
    gram = moved.T @ moved - along.T @ along
    return float(products @ np.linalg.lstsq(gram, products, rcond=RANK)[0])


def _pooled(values: Sequence[Array], training: Sequence[BoolArray]) -> Array:
    return np.concatenate([one[rows] for one, rows in zip(values, training, strict=True)])
