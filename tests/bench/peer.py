"""The problems that every contestant gets, and the peers: `python peer.py fastcan 200000 45 10`
times one on one shape.

Prints seconds and chosen columns as JSON. It runs in the peers' environment, and needs NumPy alone
beside them.
"""

from __future__ import annotations

import json
import sys

import numpy as np
from timing import median_seconds

SHAPES = ((1_000_000, 35, 8), (200_000, 45, 10), (200_000, 286, 20), (5_000, 2_000, 30))
"""Samples, candidates, terms: polynomials of two to ten inputs over long records, and one wide
dictionary.
"""


def problem(n, M, k):
    """Candidates, and k of them planted under noise of about 5 % of the output.

    In Fortran order, as dictionaries are built here, which also is the order in which the peers are
    fastest.
    """
    rng = np.random.default_rng(20)
    P = rng.standard_normal((M, n)).T
    planted = rng.choice(M, k, replace=False)
    y = P[:, planted] @ np.linspace(1, 3, k)
    return P, y + 0.05 * np.linalg.norm(y) / np.sqrt(n) * rng.standard_normal(n)


# A peer returns what runs it; this returns the chosen columns, and a function that computes the
# share of `y'y` that they explain.


def sysidentpy(P, y, k):
    from sysidentpy.model_structure_selection import FROLS

    method = FROLS(n_terms=k, order_selection=False, ylag=1, xlag=1)
    # it drops the rows before the longest lag from y, not from P
    delayed = np.concatenate([np.zeros(method.max_lag), y])[:, None]

    def run():
        err, chosen, *_ = method.run_mss_algorithm(P, delayed, k)
        return chosen[:k], lambda: np.sum(err[:k])

    return run


def fastcan(P, y, k):
    from fastcan.utils import ols

    def run():
        chosen, err = ols(P, y, k)
        return chosen, lambda: np.sum(err)

    return run


def pysindy(P, y, k):
    from pysindy.optimizers import FROLS

    method = FROLS(max_iter=k, alpha=0.0)

    def run():
        coefficients = method.fit(P, y).coef_.ravel()
        return np.flatnonzero(
            coefficients
        ), lambda: 1 - np.sum((y - P @ coefficients) ** 2) / (y @ y)

    return run


PEERS = {"sysidentpy": sysidentpy, "fastcan": fastcan, "pysindy": pysindy}


def main(name, *shape):
    n, M, k = (int(number) for number in shape)
    run = PEERS[name](*problem(n, M, k), k)
    chosen = []
    elapsed = median_seconds(lambda: chosen.append(sorted(int(i) for i in run()[0])), runs=3)
    print(json.dumps({"seconds": elapsed, "chosen": chosen[-1]}))


if __name__ == "__main__":
    main(*sys.argv[1:])
