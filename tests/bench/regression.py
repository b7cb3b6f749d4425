"""The regression engine beside the floor (one `dsyrk`), a textbook loop, and the peers."""

from __future__ import annotations

import json
import subprocess
import tracemalloc
from pathlib import Path

import numpy as np
from peer import PEERS, SHAPES, problem
from scipy.linalg.blas import dsyrk
from timing import in_turn

from mapmore_cli.modelling.frols import Regression, frols, frols_together
from mapmore_cli.modelling.frols.moments import blocks_of_rows

HERE = Path(__file__).parent
PEERS_PYTHON = HERE.parents[1] / ".venv-bench" / "bin" / "python"
RUNS = 7


def regression(say):
    """Seconds of every contestant by shape, None for one that did not run, with
    `extra_memory_ratio`; and `notes` on those that did not.
    """
    table = {}
    for shape in SHAPES:
        name = "x".join(map(str, shape))
        say(f"regression {name}")
        row, chosen = own(shape)
        row["notes"] = {}
        for peer in PEERS:
            say(f"regression {name}: {peer}")
            row[peer], note = timed_peer(peer, shape, chosen)
            if note:
                row["notes"][peer] = note
        table[name] = row
    return table


def own(shape):
    P, y = problem(*shape)
    k = shape[-1]
    row = in_turn(
        {
            "ours": lambda: frols(P, y, k),
            "dsyrk": lambda: dsyrk(1.0, P, trans=1),
            "gram": lambda: frols_together([Regression(blocks_of_rows(P, y))], k)[0],
            "textbook": lambda: textbook(P, y, k),
        },
        RUNS,
    )
    row["extra_memory_ratio"] = extra_memory(lambda: frols(P, y, k)) / P.nbytes
    return row, sorted(frols(P, y, k).chosen.tolist())


def extra_memory(function):
    """Peak of the bytes that NumPy and Python allocate during a call."""
    tracemalloc.start()
    function()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def textbook(P, y, k):
    """Modified Gram-Schmidt over all candidates in every step, as in the books."""
    Q = np.array(P, order="F")
    for _ in range(k):
        squares = np.einsum("ij,ij->j", Q, Q)
        gain = np.divide((y @ Q) ** 2, squares, out=np.zeros(len(squares)), where=squares > 0)
        pick = int(np.argmax(gain))
        unit = Q[:, pick] / np.sqrt(squares[pick])
        Q[:, pick] = 0.0
        for j in range(Q.shape[1]):
            Q[:, j] -= (unit @ Q[:, j]) * unit


def timed_peer(name, shape, chosen):
    """Seconds, and a note: why there are none, or that the peer chose other terms."""
    if not PEERS_PYTHON.exists():
        return None, "there is no environment for the peers: run `make bench`"
    done = subprocess.run(
        [PEERS_PYTHON, HERE / "peer.py", name, *map(str, shape)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        return None, (done.stderr.strip().splitlines() or ["it ended without a word"])[-1]
    result = json.loads(done.stdout.splitlines()[-1])
    return result["seconds"], None if result[
        "chosen"
    ] == chosen else f"chose {result['chosen']} instead of {chosen}"
