"""What a model may be called in C."""

from __future__ import annotations

import re

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model

WORDS = (
    "auto break case char const continue default do double else enum extern float for goto if inline int long "
    "register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while "
    "main"
)

RESERVED = frozenset(WORDS.split())
LONGEST = 40
"""Letters of a name; with what is added, compilers tell 63 letters apart."""


def identifier(name: str) -> str:
    """The name with `_` for what C does not allow; `model_` goes before a digit and before a word of the language.

    Raises
    ------
    UsageError
        Where there is no letter and no digit in it.
    """
    found = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")[:LONGEST].rstrip("_")
    if not found:
        raise UsageError(f"the model is called `{name}`, which has no letter that C allows in a name", "give the study another name")
    return f"model_{found}" if found[0].isdigit() or found in RESERVED else found


def places(model: Model, prefix: str) -> dict[str, str]:
    """The constants that name the places of the inputs, by input."""
    return {quantity.name: f"{prefix}_{quantity.name.upper()}" for quantity in model.inputs}
