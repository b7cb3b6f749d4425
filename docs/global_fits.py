"""Published formulas fitted a second time, with NumPy and SciPy alone: how low can their training
error go?

Nothing of the package is used here, neither its formulas nor its solvers. For trial values of the
parameters in which a formula is not linear, the others follow by least squares (variable
projection). One such parameter is sought on a dense grid, whose three lowest places are refined;
several are sought by differential evolution from a fixed seed, which is refined by the simplex.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution, minimize, minimize_scalar

Array = np.ndarray
Columns = Mapping[str, Array]
Terms = Callable[..., tuple[list[Array], Array | float]]
"""From the columns and the trial values to the columns that linear parameters multiply, and to what
has no linear parameter.
"""

GRID = 500
"""Trial values of a single parameter."""

SEED = 1


class Global(NamedTuple):
    """A formula: its `terms`, and the ranges of the parameters that it is not linear in.

    Every range has one sign, that of the source, and is searched by logarithms. It is of the
    parameter times the largest magnitude of the quantity `per`, over that of a quantity written as
    `1/velocity`, or of the parameter itself.
    """

    terms: Terms
    ranges: tuple[tuple[float, float], ...] = ()
    per: tuple[str | None, ...] = ()


def _sarosi(c: Columns, a3: float) -> tuple[list[Array], float]:
    p, x = c["pressure"], c["strain"]
    return [p * np.exp(a3 * x), np.exp(a3 * x), x * p, p, np.ones_like(p)], 0.0


def _polynomial(names: tuple[str, ...], order: int) -> Terms:
    """Return all monomials up to an order, of inputs over their largest magnitudes."""

    def terms(c: Columns) -> tuple[list[Array], float]:
        z = [c[name] / (np.abs(c[name]).max() or 1.0) for name in names]
        powers = np.ndindex(*[order + 1] * len(names))
        return [
            np.prod([u**k for u, k in zip(z, each, strict=True)], axis=0)
            for each in powers
            if sum(each) <= order
        ], 0.0

    return terms


def _second(c: Columns) -> tuple[list[Array], float]:
    p, x = c["pressure"], c["strain"]
    return [x**2, x * p, x, p, np.ones_like(p)], 0.0


def _braid(x: Array, theta: float) -> Any:
    return 3 * (1 - x) ** 2 / np.tan(theta) ** 2 - 1 / np.sin(theta) ** 2


def _fixed_area(c: Columns, x: Array, theta: float) -> Any:
    return 250 * np.pi * c["diameter"] ** 2 * c["pressure"] * _braid(x, theta)


def _corrected(c: Columns, a_k: float, b_k: float) -> Any:
    return (a_k * np.exp(-c["pressure"] / 100) - b_k) * c["strain"]


def _kerscher(c: Columns, theta: float, a_k: float, b_k: float) -> tuple[list[Array], float]:
    braid = c["pressure"] * _braid(_corrected(c, a_k, b_k), theta)
    return [np.exp(-40 * c["strain"]) * braid, braid], 0.0


def _bolen(c: Columns, k1: float, k2: float) -> tuple[list[Array], float]:
    x = c["strain"]
    return [np.expm1(-k1 * x), c["pressure"] * np.exp(-k2 * x**2)], 0.0


def _by(regions: list[Array], terms: list[Array]) -> list[Array]:
    return [inside * term for inside in regions for term in terms]


def _reynolds(c: Columns) -> tuple[list[Array], float]:
    ways = [c["direction"] > 0, c["direction"] < 0]
    return _by(ways, [c["strain_rate"], c["pressure"] * c["strain_rate"]]), 0.0


def _cao(c: Columns) -> tuple[list[Array], float]:
    low, rises = c["pressure"] <= 200, c["direction"] > 0
    falls = c["direction"] < 0
    regions = [rises & low, rises & ~low, falls & low, falls & ~low]
    return _by(regions, [c["strain_rate"], c["pressure"] * c["strain_rate"]]), 0.0


def _friction(*powers: Callable[[Array], Array]) -> Terms:
    def terms(c: Columns, decay: float) -> tuple[list[Array], float]:
        v = c["strain_rate"]
        own = [power(v) for power in powers]
        return [np.sign(v) * one for one in (*own, np.exp(-np.abs(v) / decay))], 0.0

    return terms


def _muscle_like(c: Columns, b0: float) -> tuple[list[Array], float]:
    p, x, moving = c["pressure"], c["length"], 1 + b0 * c["velocity"]
    return [*(p * x**k * moving for k in range(4)), np.ones_like(p), x], 0.0


def _hill(
    c: Columns, l_opt: float, w: float, v_max: float, kappa: float, n: float
) -> tuple[list[Array], float]:
    v = c["velocity"]
    length = np.exp(np.log(0.05) * np.abs((c["length"] - l_opt) / (l_opt * w)) ** 3)
    shortens = (v_max - v) / (v_max + kappa * v)
    lengthens = n - (n - 1) * (v_max + v) / (v_max - 7.56 * kappa * v)
    return [c["pressure"] * length * np.where(v > 0, shortens, lengthens)], 0.0


def _bolen_of(largest: Callable[[Array], Array], c0: float, c1: float, c2: float) -> Terms:
    def terms(c: Columns, e620: float) -> tuple[list[Array], Array]:
        x = c["strain"] / e620
        shape = c0 * np.expm1(-c1 * x) + c["pressure"] / 620 * np.exp(-c2 * x**2)
        return [], largest(c["length"]) * shape

    return terms


ANGLE = (1e-3, np.pi / 2 - 1e-3)
FACTORS = ((1e-4, 3000.0), (-300.0, -1e-4))
DECAY = ((1e-5, 300.0),)
STRAIN = ((0.005, 1.0),)

FITS: dict[str, Global] = {
    "sarosi": Global(_sarosi, ((-1500.0, -1e-5),), ("strain",)),
    "polynomial_2": Global(_second),
    "polynomial_5": Global(_polynomial(("pressure", "strain"), 5)),
    "chou_hannaford": Global(
        lambda c: ([c["pressure"] * (1 - c["strain"]) ** 2, c["pressure"]], 0.0)
    ),
    "tondu_lopez": Global(
        lambda c, theta: ([c["pressure"] * _braid(c["strain"], theta)], 0.0), (ANGLE,), (None,)
    ),
    "tondu_lopez_fixed_area": Global(
        lambda c, theta: ([], _fixed_area(c, c["strain"], theta)), (ANGLE,), (None,)
    ),
    "tondu_lopez_corrected": Global(
        lambda c, theta, *k: ([c["pressure"] * _braid(_corrected(c, *k), theta)], 0.0),
        (ANGLE, *FACTORS),
        (None, "strain", "strain"),
    ),
    "tondu_lopez_corrected_fixed_area": Global(
        lambda c, theta, *k: ([], _fixed_area(c, _corrected(c, *k), theta)),
        (ANGLE, *FACTORS),
        (None, "strain", "strain"),
    ),
    "kerscher": Global(_kerscher, (ANGLE, *FACTORS), (None, "strain", "strain")),
    "bolen": Global(_bolen, ((1e-4, 1500.0), (1e-4, 3e5)), ("strain", None)),
    "bolen_10mm": Global(
        _bolen_of(lambda rest: 303.5 * np.arctan(19.03 * (rest - 0.0075)), 0.5682, 4.254, 0.5597),
        STRAIN,
        (None,),
    ),
    "bolen_20mm": Global(
        _bolen_of(lambda rest: 922.4 * np.arctan(15.37 * (rest - 0.013)), 0.2579, 6.477, 1.321),
        STRAIN,
        (None,),
    ),
    "linear_viscous": Global(lambda c: ([c["strain_rate"]], 0.0)),
    "pressure_viscous": Global(lambda c: ([c["pressure"] * c["strain_rate"]], 0.0)),
    "reynolds": Global(_reynolds),
    "cao": Global(_cao),
    "tondu_kinetic_friction": Global(_friction(np.ones_like), DECAY, ("1/strain_rate",)),
    "peternel": Global(_friction(np.ones_like, lambda v: v, np.square), DECAY, ("1/strain_rate",)),
    "peternel_absolute": Global(
        _friction(np.ones_like, np.abs, np.square), DECAY, ("1/strain_rate",)
    ),
    "polynomial_3": Global(_polynomial(("pressure", "length", "velocity"), 3)),
    "muscle_like": Global(_muscle_like, ((-300.0, -1e-6),), ("velocity",)),
    "hill": Global(
        _hill,
        ((0.1, 10.0), (0.05, 20.0), (1.0, 100.0), (0.1, 20.0), (1.0, 3.0)),
        ("1/length", None, "1/velocity", None, None),
    ),
}
"""Every published formula whose constants are fitted to the target itself. Angles are in radians;
`diameter` and `length` are those of the muscle, in m. Ranges are wide, but for Hill's: c and w are
free there, and the force-velocity constants are those of a muscle (H eq 3).
"""


def _sum(names: list[str]) -> Global:
    """Return a sum of formulas, whose parameters follow each other."""
    parts = [FITS[name] for name in names]

    def terms(c: Columns, *values: float) -> tuple[list[Array], Array | float]:
        every, rest, first = list[Array](), np.zeros(1), 0
        for part in parts:
            own, fixed = part.terms(c, *values[first : first + len(part.ranges)])
            every, rest, first = every + own, rest + fixed, first + len(part.ranges)
        return every, rest

    ranges = tuple(ends for part in parts for ends in part.ranges)
    return Global(terms, ranges, tuple(per for part in parts for per in part.per))


def least_rmse(name: str, columns: Columns, y: Array) -> float:
    """Return the least root mean square error that a formula, or a sum such as `sarosi + bolen`,
    can have on these rows.
    """
    formula = FITS[name] if name in FITS else _sum(name.split(" + "))
    spans = [_span(per, columns) for per in formula.per]
    low, high = np.array(formula.ranges).reshape(-1, 2).T
    sign, ends = np.sign(low), np.log(np.abs(np.stack([low, high], axis=1)))
    ends.sort(axis=1)

    def sse(places: Array) -> float:
        values = sign * np.exp(np.clip(places, *ends.T)) / spans
        with np.errstate(all="ignore"):
            terms, rest = formula.terms(columns, *values)
            left = y - rest
            if terms:
                phi = np.stack(terms, axis=1)
                lengths = np.linalg.norm(phi, axis=0)
                phi = phi / np.where(lengths > 0, lengths, 1.0)
                if not np.isfinite(phi).all():
                    return np.inf
                u, s, _ = np.linalg.svd(phi, full_matrices=False)
                basis = u[:, s > 1e-13 * s[0]]
                left = left - basis @ (basis.T @ left)
        total = float(left @ left)
        return total if np.isfinite(total) else np.inf

    return float(np.sqrt(_least(sse, ends) / len(y)))


def _span(per: str | None, columns: Columns) -> float:
    if per is None:
        return 1.0
    largest = float(np.abs(columns[per.removeprefix("1/")]).max())
    return 1 / largest if per.startswith("1/") else largest


def _least(sse: Callable[[Array], float], ends: Array) -> float:
    """Return the least value of a function within the ends of its places, `(k, 2)`."""
    if not len(ends):
        return sse(np.zeros(0))
    if len(ends) > 1:
        return _evolved(sse, [(float(low), float(high)) for low, high in ends])
    low, high = map(float, ends[0])
    grid = np.linspace(low, high, GRID)
    found = np.array([sse(np.array([place])) for place in grid])
    step, least = (high - low) / (GRID - 1), float(found.min())
    for place in grid[np.argsort(found)[:3]]:
        refined: Any = minimize_scalar(
            lambda z: sse(np.array([z])),
            bounds=(max(place - step, low), min(place + step, high)),
            method="bounded",
        )
        least = min(least, float(refined.fun))
    return least


def _evolved(sse: Callable[[Array], float], ends: Any) -> float:
    evolved: Any = differential_evolution(
        sse, ends, seed=SEED, popsize=20, maxiter=150, tol=1e-8, polish=False
    )
    options: Any = {"maxiter": 4000, "fatol": 0.0, "xatol": 1e-9}
    refined: Any = minimize(sse, evolved.x, method="Nelder-Mead", options=options)
    return min(float(evolved.fun), float(refined.fun))
