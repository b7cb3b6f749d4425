"""Which samples of a recording are kept."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from mapmore_cli.spec.fields import Section, contradiction, of_sibling

OfQuantity = Annotated[float, of_sibling("quantity")]
Interval = Annotated[tuple[OfQuantity, OfQuantity], Field(strict=False)]

CONDITIONS = ("abs_below", "below", "above", "between", "outside")


class Keep(Section):
    """Samples to keep: those whose `quantity` fulfils exactly one condition, in the quantity's unit.

    Both ends of `between` are kept; both ends of `outside` are left out.
    """

    quantity: str
    abs_below: Annotated[float, Field(gt=0), of_sibling("quantity")] | None = None
    below: OfQuantity | None = None
    above: OfQuantity | None = None
    between: Interval | None = None
    outside: Interval | None = None

    @model_validator(mode="after")
    def _one_condition(self) -> Keep:
        given = [name for name in CONDITIONS if getattr(self, name) is not None]
        if len(given) != 1:
            found = "two conditions at once: " + ", ".join(f"`{name}`" for name in given) if given else "no condition"
            remedy = f"give one of {', '.join(f'`{name}`' for name in CONDITIONS)}"
            raise contradiction(f"`keep` has {found}", remedy, *given[1:], "quantity")
        for name in ("between", "outside"):
            interval = getattr(self, name)
            if interval is not None and interval[0] >= interval[1]:
                raise contradiction(f"`{name}` runs from {interval[0]:g} to {interval[1]:g}", "put the lower end first", name)
        return self
