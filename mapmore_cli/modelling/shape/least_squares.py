"""Least squares under linear inequalities, by the distance of a point to a polyhedron (Lawson and
Hanson 1974, "Solving Least Squares Problems", chapter 23).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array

# steps of the non-negative least squares for each inequality; it takes about one for each that
# binds
STEPS = 50
# by how much of the largest right side an inequality may be missed: rounding leaves far less, and
# inequalities that contradict each other far more
MISSED = 1e-6
# a smaller remainder is none
NOTHING_LEFT = 1e-30


@dataclass(frozen=True)
class Constrained:
    """Solution `theta`, (k,), and the `force` of each inequality, (m,): zero where it does not
    bind.

    Where the inequalities contradict each other, `met` is False, `theta` is the solution without
    them, and those with a force are the ones that do.
    """

    theta: Array
    force: Array
    met: bool = True


def least_squares_under(R: Array, f: Array, D: Array, d: Array) -> Constrained:
    """Minimise `|R theta - f|` under `D theta >= d`.

    With `z = R theta - f`, `H = D R^-1` and `h = d - H f` this is the least distance `min |z|, H z
    >= h` (chapter 23.4). Its dual are the non-negative least squares `[H'; h'] u ~ (0, ..., 0, 1)`;
    of their remainder r, `z = -r[:-1] / r[-1]`. No remainder means that no z meets all of them.

    `R` is upper triangular and regular, (k, k); `f` (k,), `D` (m, k) without rows of zeros, `d`
    (m,).
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    H = solve_triangular(R, D.T, trans="T").T
    length = np.linalg.norm(H, axis=1)
    H, h = H / length[:, None], (d - H @ f) / length
    reach = float(h.max(initial=0.0))  # the solution lies farther away than this; it is one unit
    if reach <= 0.0:
        return Constrained(solve_triangular(R, f), np.zeros(len(D)))
    E, right = np.vstack([H.T, h / reach]), np.append(np.zeros(len(f)), 1.0)
    force, _ = nnls(E, right, maxiter=STEPS * len(D))
    rest = E @ force - right
    z = -rest[:-1] / min(rest[-1], -NOTHING_LEFT)
    if (H @ z - h / reach).min() >= -MISSED:
        return Constrained(solve_triangular(R, f + reach * z), force)
    return Constrained(solve_triangular(R, f), force, met=False)
