"""Rate-independent hysteresis: a sum of stop (elasto-slide) operators."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array


@dataclass(frozen=True)
class Hysteresis:
    """Friction of fibres and fabric, which a moving muscle has to overcome; `m` springs in parallel, each behind a slider.

    `h(P, e) = (base + per_pressure P) sum_j shares_j s_j(e)`, where s_j is a stop operator of yield strain `yield_strains_j`.
    """

    base: float  # half-width of the full loop at no pressure, N
    per_pressure: float  # its growth, N/Pa
    yield_strains: Array  # (m,), each > 0
    shares: Array  # (m,), sum 1

    def half_width(self, pressure: Array | float) -> Array:
        """Largest |h|, N, at `pressure` (Pa)."""
        return np.asarray(self.base + self.per_pressure * np.asarray(pressure))

    def force(self, pressure: Array | float, strain: Array) -> Array:
        """Force h, N, `(n,)`, along a path that starts relaxed: positive in contraction, where it takes from the muscle's pull."""
        return np.asarray(self.half_width(pressure) * (stop(strain, self.yield_strains) @ self.shares))


def stop(path: Array, yields: Array) -> Array:
    """States `(n, m)` of m stop operators along a path of n inputs; relaxed (zero) at its first sample.

    `s_j[k] = min(1, max(-1, s_j[k-1] + (x[k] - x[k-1])/y_j))`: only the order of the inputs counts, not their timing.
    """
    states = np.zeros((len(path), len(yields)))
    for k, step in enumerate(np.diff(path), start=1):
        states[k] = np.minimum(1.0, np.maximum(-1.0, states[k - 1] + step / yields))
    return states


def stop_rates(states: Array, yields: Array, rate: float) -> Array:
    """Rates `(m,)`, 1/s, of the same operators while their input moves at `rate`: `x'/y_j`, zero where they slide."""
    return np.where((np.abs(states) >= 1.0) & (states * rate > 0.0), 0.0, rate / yields)
