"""Candidate terms that wait for a training range: x in `unit(x)` runs from 0 to 1 along it, in
`own_unit(x)` it has the unit of the model.

`abs(unit(strain - 0.1))^3` becomes `abs((strain - 93)/830)^3`.
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
"""Significant digits of a width, and of a place as part of the range: enough, and short."""

Courses = tuple[tuple[str, tuple[float, float, float, float]], ...]
"""Least and greatest training value of inputs and states: in the coordinate of the terms, and in
the unit of the model.
"""


def placed(texts: tuple[str, ...], courses: Courses) -> tuple[str, ...]:
    """Return all terms with the numbers of their training ranges, each once."""
    if not any(RANGED[0] in text for text in texts):
        return texts
    has_own = any(RANGED[1] in text for text in texts)
    return _placed(
        texts,
        tuple(
            (name, (*_without_rounding(*ends[:2]), *(ends[2:] if has_own else ())))
            for name, ends in courses
        ),
    )


def _without_rounding(low: float, high: float) -> tuple[float, float]:
    """Return the ends of a range without the last digits, in which segments that are scaled alike
    differ.
    """
    width = float(f"{high - low:.9g}") or 1.0
    low = round(low / width, 9) * width
    return low, low + width if high > low else low


@lru_cache(maxsize=64)
def _placed(
    texts: tuple[str, ...], courses: tuple[tuple[str, tuple[float, ...]], ...]
) -> tuple[str, ...]:
    ranges = dict(courses)

    def line(unit: str, distance: Expression) -> Expression:
        """Return a straight line over a range, with the numbers of that range."""
        (name,) = distance.names
        start, end = evaluate(distance, {name: np.arange(2.0)}, 2).tolist()
        low, high, *own = ranges[name]
        width = float(f"{high - low:.{DIGITS}g}") or 1.0
        part, digits = start / (start - end), DIGITS - 1 - math.floor(math.log10(width))
        if unit != RANGED[0]:  # a place that somebody gave keeps more digits
            part, digits = (part - own[0]) / (own[1] - own[0] or 1.0), digits + 2
        return _over(
            Name(name) - round(low + (high - low) * part, digits),
            float(f"{width / (end - start):.{DIGITS}g}"),
        )

    return tuple(dict.fromkeys(to_text(parse(text, line)) for text in texts))


def _over(distance: Expression, width: float) -> Expression:
    return distance if width == 1.0 else distance / width
