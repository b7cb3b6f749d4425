"""Define the Bouc-Wen model of smooth hysteresis, which has two rates. The model is integrated
exactly. If both rates are equal, it is Dahl's friction model.
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

# limit of the exponent in exp(); beyond this limit, the state is practically infinite
STEEPEST = 700.0
# upper bound of the rates p and q in training
# With this bound, the state adapts to a reversal while x moves by 1e-4 of its training range.
MOST = 1e4


def recursion(setting: Setting) -> Recursion:
    """Return the rule of the state z with `dz/du = 1 - p |z|` while z moves away from zero, and
    `dz/du = 1 + q |z|` while z moves towards zero. The input u is x divided by its training range.

    In one step, u changes by d. Let s be the sign of d, let a be its magnitude, and let w = s z. On
    each side of zero, w is a first-order lag in a. After the step, it is `w' = w exp(-r a) + (1 -
    exp(-r a))/r`, with r = q for w < 0 and r = p otherwise. From w < 0, zero is reached after `a =
    ln(1 - q w)/q`. Sources: Y. K. Wen 1976; P. R. Dahl 1968 (p = q).
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
    """Return w after a change of the input by the distance a, if w is a first-order lag with this
    rate: `w exp(-rate a) + (1 - exp(-rate a))/rate`, or `w + a` if the rate is 0.
    """
    if rate == 0:
        return w + a
    less = m.call("expm1", m.clip(-rate * a, -STEEPEST, STEEPEST))
    return w + w * less - less / rate


def _rates(least: float) -> tuple[Parameter, Parameter]:
    return (
        Parameter("p", "1", "2", above=-64.0, between=lambda _step, _longest: (least, MOST)),
        Parameter("q", "1", "8", between=lambda _step, _longest: (0.0, MOST), or_zero=True),
    )


GRID = tuple((p, q) for p in (0.0, 2.0, 8.0, 32.0) for q in (0.0, 2.0, 8.0, 32.0))
STIFFENING = tuple((p, q) for p in (-4.0, -1.0) for q in (2.0, 8.0, 32.0) if q > -p)
"""Pairs of rates from which a search begins. A state that turns back more slowly than it grows
would be unbounded.
"""


OPERATORS = (
    Operator(
        name="wen",
        summary=(
            "Smooth hysteresis (Bouc-Wen) of the quantities in `of`. The larger the rate `p` is, "
            "the sooner the state saturates. The larger the rate `q` is, the faster the state "
            "returns to zero after a reversal. The input of the state is the quantity divided by "
            "its training range. If `p` and `q` are not given, training estimates them, with 0 as "
            "the smallest value."
        ),
        recursion=recursion,
        parameters=_rates(0.0),
        needs="range",
        starts=lambda _step, _longest: GRID,
        timed=False,
    ),
    Operator(
        name="wen_stiffening",
        summary=(
            "Hysteresis as in `wen`, but `p` may be negative. With a negative `p`, the state grows "
            "faster the farther it moves, and has no bound."
        ),
        recursion=recursion,
        parameters=_rates(-8.0),
        needs="range",
        starts=lambda _step, _longest: (*STIFFENING, *GRID),
        timed=False,
    ),
    Operator(
        name="dahl",
        summary=(
            "Dahl's friction of the quantities in `of`. It is `wen` with one `rate` for both p and "
            "q. Training estimates the rate if it is not given."
        ),
        recursion=recursion,
        parameters=(
            Parameter("rate", "1", "20", between=lambda _step, _longest: (0.0, MOST), or_zero=True),
        ),
        needs="range",
        starts=lambda _step, _longest: ((1.0,), (4.0,), (16.0,), (64.0,), (256.0,), (1024.0,)),
        timed=False,
    ),
)
