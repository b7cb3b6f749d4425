"""What is written beside a stored value: its description and its unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import h5py

NO_UNIT = "-"
"""Unit of texts, identifiers and row numbers."""


@dataclass(frozen=True)
class Label:
    """Description and unit of a field, and the units known where it stands.

    `unit` may name quantities in square brackets: `[target]^2` is the square of the target's unit. `[*]` stands for the key or number of
    the part being written. What `scope` does not know stays in brackets, as documented in docs/file-format.md.
    """

    description: str = ""
    unit: str = "1"
    scope: Mapping[str, str] = field(default_factory=dict)

    def of_part(self, key: str) -> Label:
        """Return the label of one part of a sequence or mapping."""
        return replace(self, unit=self.unit.replace("*", key)) if "*" in self.unit else self

    def of_field(self, description: str, unit: str) -> Label:
        """Return the label of a field of the object being written; a `*` of the field is still open."""
        return replace(self, description=description, unit=unit)

    def within(self, units: Mapping[str, str]) -> Label:
        """Return the label with the units that an object knows added to the scope."""
        every = {**self.scope, **units}
        return replace(self, scope={**self.scope, **{name: _resolved(unit, every) for name, unit in units.items()}})

    def without_unit(self) -> Label:
        """Return the label of something that has no unit."""
        return replace(self, unit=NO_UNIT)

    def put_on(self, dataset: h5py.Dataset) -> None:
        """Write the two attributes."""
        dataset.attrs["unit"] = _resolved(self.unit, self.scope)
        dataset.attrs["description"] = self.description


def _resolved(unit: str, scope: Mapping[str, str]) -> str:
    """Return the unit with every known `[name]` replaced; a compound unit gets parentheses before a power."""

    def known(match: re.Match[str]) -> str:
        name, power = match.groups()
        found = scope.get(name, f"[{name}]")
        return f"({found}){power}" if power and re.search(r"[*/ ^]", found) else f"{found}{power}"

    return re.sub(r"\[([^\]]*)\](\^?)", known, unit)
