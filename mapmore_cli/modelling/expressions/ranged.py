"""Insert the training range of a quantity into candidate terms that contain `unit`. `unit(x)`
stands for x scaled so that it runs from 0 to 1 over its training range.

For example, if the strain runs from 10 to 840 in training, `abs(unit(strain - 0.1))^3` becomes
`abs((strain - 93)/830)^3`.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from mapmore_cli.modelling.expressions.evaluation import evaluate
from mapmore_cli.modelling.expressions.parsing import RANGED, parse
from mapmore_cli.modelling.expressions.printing import to_text
from mapmore_cli.modelling.expressions.syntax import Expression, Name

DIGITS = 4
"""Significant digits of a width, and of a position as a fraction of the range. They are enough, and
keep the text short.
"""

Courses = tuple[tuple[str, float, float], ...]
"""Name, smallest and largest training value of each input and state."""


def placed(texts: tuple[str, ...], courses: Courses) -> tuple[str, ...]:
    """Return the terms, in which every call of `unit` is replaced by a linear function with numbers
    from the training ranges. If several terms become equal, the term is returned only once.
    """
    if not any(RANGED in text for text in texts):
        return texts
    return _placed(texts, tuple(_without_rounding(*course) for course in courses))


def _without_rounding(name: str, low: float, high: float) -> tuple[str, float, float]:
    """Return a range whose ends are rounded to nine digits of its width. Ranges that differ by
    rounding errors only, such as those of segments with equal scaling, become equal.
    """
    width = float(f"{high - low:.9g}") or 1.0
    low = round(low / width, 9) * width
    return name, low, low + width if high > low else low


@lru_cache(maxsize=64)
def _placed(texts: tuple[str, ...], courses: Courses) -> tuple[str, ...]:
    ranges = {name: (low, high) for name, low, high in courses}

    def line(distance: Expression) -> Expression:
        """Return `unit(distance)` as a linear function of the quantity, with numbers from its
        training range.
        """
        (name,) = distance.names
        start, end = evaluate(distance, {name: np.arange(2.0)}, 2).tolist()
        low, high = ranges[name]
        width = float(f"{high - low:.{DIGITS}g}") or 1.0
        place = low + (high - low) * (start / (start - end))
        along: Expression = Name(name) - round(place, DIGITS - 1 - math.floor(math.log10(width)))
        unit = float(f"{width / (end - start):.{DIGITS}g}")
        return along if unit == 1.0 else along / unit

    return tuple(dict.fromkeys(to_text(parse(text, line)) for text in texts))
