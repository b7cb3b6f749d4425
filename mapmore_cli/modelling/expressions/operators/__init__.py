"""Collect all operators, most of which have memory. To add an operator, add a file that defines
`OPERATORS`, add a row to an existing file, or define an entry point.
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
    """Return the operators of every family, by the key of the family in a spec. A family consists
    of operators with the same parameters, for example `resonance` and `resonance_velocity`.

    An operator without parameters belongs to no family. A spec uses such an operator by its name,
    for example `rate(pressure)`.
    """
    written: dict[str, tuple[Operator, ...]] = {}
    for operator in OPERATORS.values():
        key = operator.family or operator.name
        if operator.parameters:
            written[key] = (*written.get(key, ()), operator)
    return written
