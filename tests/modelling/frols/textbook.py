"""FROLS as on paper, candidate by candidate."""

import numpy as np

from mapmore_cli.modelling.frols import Regression, Weighing, frols_together
from mapmore_cli.modelling.frols.remainders import RANK_TOLERANCE


def textbook(P, y, max_terms):
    """Select terms as on paper, candidate by candidate (Billings 2013, section 3.2; the equations
    stand in `frols`).

    Returns the k chosen columns, their g and ERR, (k,), the coefficients of the original columns,
    (k,), and the ERR of every candidate in every iteration, (k, M), NaN where chosen or dependent.
    """
    chosen = []
    basis = []
    g, table = [], []
    while len(chosen) < max_terms:
        left, err = {}, np.full(P.shape[1], np.nan)
        for m in set(range(P.shape[1])) - set(chosen):
            q = P[:, m]
            for w in basis * 2:  # twice is enough (Giraud and Langou 2005)
                q = q - (w @ q) / (w @ w) * w
            if q @ q > RANK_TOLERANCE * (P[:, m] @ P[:, m]):
                left[m], err[m] = q, (y @ q) ** 2 / (q @ q) / (y @ y)
        if not left:
            break
        best = int(np.nanargmax(err))
        chosen.append(best)
        basis.append(left[best])
        g.append((y @ left[best]) / (left[best] @ left[best]))
        table.append(err)
        if 1 - sum(row[m] for row, m in zip(table, chosen, strict=True)) <= 0:
            break
    W, k = np.column_stack(basis), len(chosen)
    A = np.triu((W.T @ P[:, chosen]) / np.sum(W**2, axis=0)[:, None])  # P_chosen = W A
    theta = np.linalg.solve(A, np.array(g))
    return (
        chosen,
        np.array(g),
        np.array([table[i][chosen[i]] for i in range(k)]),
        theta,
        np.array(table),
    )


def frols_streamed(blocks, *how, weighing=None, only=None, **more):
    """The selection of one output whose dictionary comes in blocks."""
    (found,) = frols_together([Regression(blocks, weighing or Weighing(), only)], *how, **more)
    return found
