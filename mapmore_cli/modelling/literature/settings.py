"""What a spec says of a family of muscles."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Gt

from mapmore_cli.domain.declared import Settings


@dataclass(frozen=True, kw_only=True)
class FamilySettings(Settings):
    """What specimens of a family differ in: the quantity `of`, one value for each, as the rest length.

    The largest force follows from it: `scale: saturating` is `a atan(rate (l - dead))` of a length, `power` is `a l^rate`. `rate` is the
    centre of a prior (19.03 per metre, of a power 2), `dead` the length in m of the fittings (0.0075).
    """

    of: str
    scale: Literal["saturating", "power"] = "saturating"
    rate: Annotated[float, Gt(0)] | None = None
    dead: float = 0.0075

    @property
    def centre(self) -> float:
        """The centre of the prior of b."""
        return self.rate or (19.03 if self.scale == "saturating" else 2.0)

    def definition(self, metres: float) -> str:
        """Return the family as a text that travels with its fit; one unit of `of` is so many `metres` (1 for other quantities)."""
        return json.dumps({"family": {**vars(self), "rate": self.centre, "metres": metres}}, sort_keys=True)


def is_family(name: str) -> bool:
    """Whether the name of a formula is the definition of a family."""
    return name.startswith('{"family"')
