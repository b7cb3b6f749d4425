"""Collect the operators with memory, and a few without. To add an operator, add a file with
`OPERATORS`, a row to such a file, or an entry point.
"""

from __future__ import annotations

from collections.abc import Mapping

from mapmore_cli.domain import plugins
from mapmore_cli.modelling.expressions.operator import Operator

OPERATORS: Mapping[str, Operator] = {
    part.name: part.value for part in plugins.parts("operators", Operator, __name__)
}
"""All operators by name."""


def families() -> Mapping[str, tuple[Operator, ...]]:
    """Return the operators of each family of a spec, by the family's key.

    An operator without numbers has no family: a spec writes its name, for example `rate(pressure)`.
    """
    written: dict[str, tuple[Operator, ...]] = {}
    for operator in OPERATORS.values():
        key = operator.family or operator.name
        if operator.parameters:
            written[key] = (*written.get(key, ()), operator)
    return written
