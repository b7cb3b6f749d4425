"""A spec under way."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from mapmore_cli.stages.drafting.yaml_text import Loc, Note, to_yaml

HEAD = ("Started by `mapmore init`. Every guess says why: look first at those marked CHECK, then run `mapmore check` on this file.",)


@dataclass(frozen=True)
class Draft:
    """Sections as the YAML will hold them, with numbers in the model's units, and why they were chosen."""

    spec: dict[str, Any]
    notes: dict[Loc, Note] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the study."""
        return str(self.spec["name"])

    @property
    def data(self) -> dict[str, Any]:
        """The `data` section."""
        section: dict[str, Any] = self.spec["data"]
        return section

    def with_data(self, key: str, value: Any, why: str | None = None, sure: bool = True) -> Draft:
        """The draft with a key of `data` added or replaced."""
        return replace(self, spec={**self.spec, "data": {**self.data, key: value}}).noted(("data", key), why, sure)

    def with_section(self, key: str, value: Any, why: str | None = None, sure: bool = True) -> Draft:
        """The draft with a section added or replaced."""
        return replace(self, spec={**self.spec, key: value}).noted((key,), why, sure)

    def noted(self, loc: Loc, why: str | None, sure: bool = True) -> Draft:
        """The draft with a note about one of its places; none for None."""
        return self if why is None else replace(self, notes={**self.notes, loc: Note(why, sure)})

    def text(self) -> str:
        """The draft as YAML."""
        return to_yaml(self.spec, self.notes, HEAD)
