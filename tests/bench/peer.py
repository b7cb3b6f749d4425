"""Times one peer on one shape, in the peers' environment: `python peer.py fastcan 200000 45 10`.

Prints seconds and chosen columns as JSON.
"""

from __future__ import annotations

import json
import sys

import numpy as np
from problems import problem
from timing import median_seconds


def sysidentpy(P, y, k):
    from sysidentpy.model_structure_selection import FROLS

    method = FROLS(n_terms=k, order_selection=False, ylag=1, xlag=1)
    delayed = np.concatenate([np.zeros(method.max_lag), y])[:, None]  # it drops the rows before the longest lag from y, not from P
    return lambda: method.run_mss_algorithm(P, delayed, k)[1][:k]


def fastcan(P, y, k):
    from fastcan.utils import ols

    return lambda: ols(P, y, k)[0]


def pysindy(P, y, k):
    from pysindy.optimizers import FROLS

    method = FROLS(max_iter=k, alpha=0.0)
    return lambda: np.flatnonzero(method.fit(P, y).coef_)


PEERS = {"sysidentpy": sysidentpy, "fastcan": fastcan, "pysindy": pysindy}


def main(name, *shape):
    n, M, k = (int(number) for number in shape)
    run = PEERS[name](*problem(n, M, k), k)
    chosen = []
    elapsed = median_seconds(lambda: chosen.append(sorted(int(i) for i in run())), runs=3)
    print(json.dumps({"seconds": elapsed, "chosen": chosen[-1]}))


if __name__ == "__main__":
    main(*sys.argv[1:])
