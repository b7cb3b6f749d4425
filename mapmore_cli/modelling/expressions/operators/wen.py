"""Smooth hysteresis with two rates: Bouc-Wen's state, integrated exactly; with one rate it is
Dahl's friction.
"""

from __future__ import annotations

from mapmore_cli.modelling.expressions.operator import (
    Amount,
    Arithmetic,
    Operator,
    Parameter,
    Recursion,
    Setting,
)

# largest exponent: beyond it, a state is as good as infinite, and the run has diverged
STEEPEST = 700.0
MOST = 1e4  # largest rate that training tries: the loop turns within 1e-4 of the range


def recursion(setting: Setting) -> Recursion:
    """Return z with `dz/du = 1 - p |z|` moving away from zero, `1 + q |z|` moving towards it; u is
    x divided by its training range.

    Over one step u changes by d; s is its sign, a its size, and w = s z. Each branch is a
    first-order lag in a: `w' = w exp(-r a) + (1 - exp(-r a))/r`, r = q where w < 0 and p elsewhere.
    A step from w < 0 reaches zero after `a = ln(1 - q w)/q`. Sources: Y. K. Wen 1976; P. R. Dahl
    1968 (p = q).
    """
    p, q = setting.numbers[0], setting.numbers[-1]
    low, high = setting.limits
    per = 1 / (high - low) if high > low else 0.0

    def following(m: Arithmetic, z: Amount, x: Amount, before: Amount) -> Amount:
        d = (x - before) * per
        falls = d < 0
        a, w = m.where(falls, -d, d), m.where(falls, -z, z)
        back = m.clip(w, None, 0.0)
        zero = -back if q == 0 else m.call("log1p", -q * back) / q

        def turning() -> Amount:
            return m.where(
                a <= zero, lambda: _relaxed(m, back, q, a), lambda: _relaxed(m, 0.0, p, a - zero)
            )

        after = m.where(w < 0, turning, lambda: _relaxed(m, w, p, a))
        return m.where(falls, -after, after)

    return Recursion(1, 1, following, lambda x: 0.0 * x)


def _relaxed(m: Arithmetic, w: Amount, rate: float, a: Amount) -> Amount:
    """Return `w exp(-rate a) + (1 - exp(-rate a))/rate`."""
    if rate == 0:
        return w + a
    less = m.call("expm1", m.clip(-rate * a, -STEEPEST, STEEPEST))
    return w + w * less - less / rate


def _rates(least: float) -> tuple[Parameter, Parameter]:
    return (
        Parameter("p", "1", "2", above=-64.0, between=lambda _step, _longest: (least, MOST)),
        Parameter("q", "1", "8", above=-1e-9, between=lambda _step, _longest: (0.0, MOST)),
    )


GRID = tuple((p, q) for p in (0.0, 2.0, 8.0, 32.0) for q in (0.0, 2.0, 8.0, 32.0))
STIFFENING = tuple((p, q) for p in (-4.0, -1.0) for q in (2.0, 8.0, 32.0) if q > -p)
"""Pairs of rates that a search begins from; a state that turns back more slowly than it grows has
no bound.
"""


OPERATORS = (
    Operator(
        name="wen",
        summary="Smooth hysteresis (Bouc-Wen) on the quantities `of`: a state that saturates at "
        "the rate `p` and turns back at the rate "
        "`q`, both per training range; training finds them where not given, from 0 on.",
        recursion=recursion,
        parameters=_rates(0.0),
        needs="range",
        starts=lambda _step, _longest: GRID,
    ),
    Operator(
        name="wen_stiffening",
        summary="As `wen`, where `p` may be negative: the state grows faster the further it "
        "moves, and has no bound.",
        recursion=recursion,
        parameters=_rates(-8.0),
        needs="range",
        starts=lambda _step, _longest: (*STIFFENING, *GRID),
    ),
    Operator(
        name="dahl",
        summary="Dahl's friction on the quantities `of`: `wen` with one `rate`, p = q; training "
        "finds it where not given.",
        recursion=recursion,
        parameters=(
            Parameter("rate", "1", "20", above=-1e-9, between=lambda _step, _longest: (0.0, MOST)),
        ),
        needs="range",
        starts=lambda _step, _longest: ((1.0,), (4.0,), (16.0,), (64.0,), (256.0,), (1024.0,)),
    ),
)
