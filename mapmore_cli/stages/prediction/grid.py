"""Lookup tables: the points of a regular grid over the inputs of a model, as lines of a table."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Sequence
from itertools import product

from mapmore_cli.domain.errors import UsageError

EXAMPLE = "write it as pressure=0:600:25,strain=0:0.25:0.01 (first:last:step, or one value)"
MOST_POINTS = 10_000_000
"""Points of a table beyond which a step is taken for a slip of the pen."""


def grid_lines(text: str, inputs: Sequence[str]) -> Iterator[str]:
    """Yield the header and the points of a grid, the last input of `text` varying fastest; both ends are included.

    Raises
    ------
    UsageError
        Where `text` is malformed, names an input twice or one that the model has not, leaves one out, or has a step that does not lead from
        the first value to the last.
    """
    return _lines(_of_inputs(text, inputs))


def grid_axes(text: str, inputs: Sequence[str]) -> dict[str, list[float]]:
    """The places along every input of a grid; raises as `grid_lines`."""
    return {name: list(map(float, values)) for name, values in _of_inputs(text, inputs).items()}


def _of_inputs(text: str, inputs: Sequence[str]) -> dict[str, list[str]]:
    axes = _axes(text)
    for name in axes:
        if name not in inputs:
            near = difflib.get_close_matches(name, inputs, n=1)
            hint = f"did you mean '{near[0]}'? " if near else ""
            raise UsageError(f"--grid: the model has no input '{name}'", f"{hint}it has {', '.join(inputs)}")
    if missing := [name for name in inputs if name not in axes]:
        raise UsageError(f"--grid: no values for {', '.join(missing)}", EXAMPLE)
    points = math.prod(map(len, axes.values()))
    if points > MOST_POINTS:
        raise UsageError(f"--grid: asks for {points} points, more than {MOST_POINTS}", "choose larger steps, or predict a table")
    return axes


def _lines(axes: dict[str, list[str]]) -> Iterator[str]:
    yield ",".join(axes) + "\n"
    for point in product(*axes.values()):
        yield ",".join(point) + "\n"


def _axes(text: str) -> dict[str, list[str]]:
    axes: dict[str, list[str]] = {}
    for part in text.split(","):
        name, equals, values = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise UsageError(f"--grid: '{part.strip()}' has no '='", EXAMPLE)
        if name in axes:
            raise UsageError(f"--grid: '{name}' is given twice", EXAMPLE)
        axes[name] = [format(value, ".12g") for value in _values(part.strip(), values)]
    return axes


def _values(part: str, text: str) -> list[float]:
    try:
        numbers = [float(number) for number in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 3) or not all(map(math.isfinite, numbers)):
        raise UsageError(f"--grid: cannot read '{part}'", EXAMPLE)
    if len(numbers) == 1:
        return numbers
    first, last, step = numbers
    steps = (last - first) / step if step else math.nan
    if not 0 <= steps <= MOST_POINTS:
        raise UsageError(f"--grid: '{part}' does not lead from {first:g} to {last:g} in at most {MOST_POINTS} steps", EXAMPLE)
    if abs(steps - round(steps)) > 1e-6:
        raise UsageError(f"--grid: {last:g} is not a whole number of steps of {step:g} from {first:g}", "choose another step or last value")
    return [first + i * step for i in range(round(steps))] + [last]
