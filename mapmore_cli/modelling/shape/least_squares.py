"""Solve least squares under linear inequalities, as the distance of a point from a polyhedron
(Lawson and Hanson 1974, "Solving Least Squares Problems", chapter 23).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array

# largest number of steps of the non-negative least squares, for each inequality; it needs about one
# step for each binding inequality
STEPS = 50
# an inequality counts as fulfilled if it is missed by less than this fraction of the largest right
# side: rounding causes far less, and contradictory inequalities far more
MISSED = 1e-6
# a remainder of the dual problem below this counts as zero
NOTHING_LEFT = 1e-30


@dataclass(frozen=True)
class Constrained:
    """Solution `theta`, shape (k,), and the `force` (Lagrange multiplier) of each inequality, shape
    (m,): zero if it does not bind.

    If the inequalities contradict each other, `met` is False, `theta` is the solution without them,
    and the contradicting inequalities have a nonzero force.
    """

    theta: Array
    force: Array
    met: bool = True


def least_squares_under(R: Array, f: Array, D: Array, d: Array) -> Constrained:
    """Minimise `|R theta - f|` subject to `D theta >= d`.

    With `z = R theta - f`, `H = D R^-1` and `h = d - H f` this is the least-distance problem `min
    |z|, H z >= h` (chapter 23.4). Its dual is the non-negative least-squares problem `[H'; h'] u ~
    (0, ..., 0, 1)`. From the remainder r of the dual, `z = -r[:-1] / r[-1]`. A remainder of zero
    means that no z fulfils all inequalities.

    `R` is upper triangular and regular, (k, k); `f` (k,), `D` (m, k) without rows of zeros, `d`
    (m,).
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    H = solve_triangular(R, D.T, trans="T").T
    length = np.linalg.norm(H, axis=1)
    H, h = H / length[:, None], (d - H @ f) / length
    # the solution lies farther from the origin than this distance, which is used as the unit of
    # length
    reach = float(h.max(initial=0.0))
    if reach <= 0.0:
        return Constrained(solve_triangular(R, f), np.zeros(len(D)))
    E, right = np.vstack([H.T, h / reach]), np.append(np.zeros(len(f)), 1.0)
    force, _ = nnls(E, right, maxiter=STEPS * len(D))
    rest = E @ force - right
    z = -rest[:-1] / min(rest[-1], -NOTHING_LEFT)
    if (H @ z - h / reach).min() >= -MISSED:
        return Constrained(solve_triangular(R, f + reach * z), force)
    return Constrained(solve_triangular(R, f), force, met=False)
