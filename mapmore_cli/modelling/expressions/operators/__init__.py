"""Operators with memory, and a few without. Adding one is adding a file with `OPERATORS`, or a row
to one.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping

from mapmore_cli.modelling.expressions.operator import Operator


def _all_operators() -> Iterator[Operator]:
    for module in sorted(found.name for found in pkgutil.iter_modules(__path__)):
        yield from importlib.import_module(f"{__name__}.{module}").OPERATORS


# every operator by its name
OPERATORS: Mapping[str, Operator] = {operator.name: operator for operator in _all_operators()}


def families() -> Mapping[str, tuple[Operator, ...]]:
    """Return the operators that each family of a spec writes, by its key.

    An operator without numbers has no family: a spec writes its name, as `rate(pressure)`.
    """
    written: dict[str, tuple[Operator, ...]] = {}
    for operator in OPERATORS.values():
        key = operator.family or operator.name
        if operator.parameters:
            written[key] = (*written.get(key, ()), operator)
    return written
