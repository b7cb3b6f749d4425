"""Solve least-squares problems with linear inequalities as constraints (Lawson and Hanson 1974,
"Solving Least Squares Problems", chapter 23).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array

# largest number of steps of the non-negative least squares, divided by the number of inequalities
# The algorithm needs about one step for each inequality that binds.
STEPS = 50
# tolerance of the inequalities, as a fraction of the largest right-hand side
# The tolerance is much larger than rounding errors.
# If inequalities contradict each other, their violations are much larger than the tolerance.
MISSED = 1e-6
# a residual of the dual problem below this limit is treated as zero
NOTHING_LEFT = 1e-30


@dataclass(frozen=True)
class Constrained:
    """Solution `theta`, shape (k,), and the Lagrange multiplier (`force`) of each inequality, shape
    (m,). The multiplier is zero for an inequality that does not bind.

    If inequalities contradict each other, `met` is False, `theta` is the solution without
    inequalities, and the multipliers of the contradicting inequalities are not zero.
    """

    theta: Array
    force: Array
    met: bool = True


def least_squares_under(R: Array, f: Array, D: Array, d: Array) -> Constrained:
    """Minimise `|R theta - f|` subject to `D theta >= d`.

    With `z = R theta - f`, `H = D R^-1` and `h = d - H f` this is the least-distance problem `min
    |z|, H z >= h` (chapter 23.4). Its dual is the non-negative least-squares problem `[H'; h'] u ~
    (0, ..., 0, 1)`. With the residual r of the dual, the solution is `z = -r[:-1] / r[-1]`. If r is
    zero, no z satisfies all inequalities.

    R, (k, k), is upper triangular and regular, and D, (m, k), has no rows of zeros. The shapes of f
    and d are (k,) and (m,).
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    H = solve_triangular(R, D.T, trans="T").T
    length = np.linalg.norm(H, axis=1)
    H, h = H / length[:, None], (d - H @ f) / length
    # lower bound of the distance of the solution from the origin, used as the unit of length
    reach = float(h.max(initial=0.0))
    if reach <= 0.0:
        return Constrained(solve_triangular(R, f), np.zeros(len(D)))
    E = np.vstack([H.T, h / reach])
    right = np.append(np.zeros(len(f)), 1.0)
    force, _ = nnls(E, right, maxiter=STEPS * len(D))
    rest = E @ force - right
    z = -rest[:-1] / min(rest[-1], -NOTHING_LEFT)
    if (H @ z - h / reach).min() >= -MISSED:
        return Constrained(solve_triangular(R, f + reach * z), force)
    return Constrained(solve_triangular(R, f), force, met=False)
