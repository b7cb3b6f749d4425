"""Five small dictionaries, and what each peer reports of them, in the peers' environment: `python
peer_cases.py` prints JSON.

The share that a selection explains is of `y'y`: the sum of its ERR as the peer reports it, or, for
a peer that reports none, what its coefficients explain.
"""

from __future__ import annotations

import json
import warnings

import numpy as np
from peer import PEERS


def cases():
    """Name, candidates (n, M), output (n,) and number of terms that is asked for."""
    t = np.linspace(0, 1, 60)
    x = np.linspace(2, 4, 60)
    white = {seed: np.random.default_rng(seed).normal(size=(80, 10)) for seed in (7, 8, 9)}
    sum_of_two = white[8][:, :6].copy()
    sum_of_two[:, 4] = sum_of_two[:, 0] + sum_of_two[:, 1]
    noise = np.random.default_rng(10).normal(size=80)
    scaled = white[9][:, :6] * 10.0 ** np.array([-9, 0, 9, 0, -6, 3])
    yield (
        "a first sample of zero",
        np.column_stack([t**i for i in range(6)]),
        np.exp(-3 * t) + t**5,
        6,
    )
    yield (
        "nothing left to explain",
        white[7],
        2 * white[7][:, 3] - white[7][:, 8] + 0.5 * white[7][:, 1],
        10,
    )
    yield (
        "a column that is the sum of two",
        sum_of_two,
        sum_of_two[:, 0] + 2 * sum_of_two[:, 1] + 0.1 * noise,
        6,
    )
    yield (
        "powers to the ninth on [2, 4]",
        np.column_stack([x**i for i in range(10)]),
        np.sin(3 * x),
        8,
    )
    yield (
        "units from 1e-9 to 1e9",
        scaled,
        white[9][:, :3] @ np.array([1.0, 2.0, 3.0]) + 0.1 * noise,
        3,
    )


def largest(P, y):
    """Share of `y'y` that least squares on all columns explains: no selection explains more."""
    fit = P / np.linalg.norm(P, axis=0)
    return 1 - float(np.sum((y - fit @ np.linalg.lstsq(fit, y, rcond=None)[0]) ** 2) / (y @ y))


def main():
    found = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, P, y, k in cases():
            found[name] = {}
            for peer, runner in PEERS.items():
                chosen, share = runner(P, y, k)()
                found[name][peer] = {"terms": len(chosen), "share": float(share())}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
