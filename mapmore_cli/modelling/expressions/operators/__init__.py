"""Operators with memory, and a few without. Adding one is adding a file with `OPERATORS`, a row
to one, or an entry point.
"""

from __future__ import annotations

from collections.abc import Mapping

from mapmore_cli.domain import plugins
from mapmore_cli.modelling.expressions.operator import Operator

OPERATORS: Mapping[str, Operator] = {
    part.name: part.value for part in plugins.parts("operators", Operator, __name__)
}
"""Every operator by its name."""


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
