"""Marks of the numbers in a spec of the rig that no study has (`mapmore_cli.domain.declared`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from annotated_types import Ge, Gt

from mapmore_cli.domain.declared import Handler

Positive = Annotated[float, Gt(0)]
NonNegative = Annotated[float, Ge(0)]


@dataclass(frozen=True)
class After:
    """Marks a value that a function checks or converts after the marks before it; what the function
    returns is kept.
    """

    function: Callable[[Any], Any]

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return the value's schema, and the function behind it."""
        return {
            "type": "function-after",
            "function": {"type": "no-info", "function": self.function},
            "schema": handler(source),
        }
