"""What a model and its quantities are called in other languages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.foreign import WORDS, identifiers
from mapmore_cli.domain.recording import Quantity

RESERVED = frozenset([*(word.lower() for word in WORDS), "model", "co_simulation", "numpy", "aux", "con", "nul", "prn"])
"""Words of the languages, names of what lies around a model, and what Windows keeps for devices."""

LONGEST = 40
"""Letters of a name; with what is added, compilers tell 63 letters apart."""

PYTHON = ("np", "float", "s", "finite", "_beyond", "state", "State", "step", "evaluate")
"""Names in functions of a module that its inputs must not hide."""


def identifier(name: str) -> str:
    """Return the name with `_` for what C does not allow; `model_` goes before a digit and before a reserved word.

    The same before `x` and `x_...`: `x_reset` is an input in C.

    Raises
    ------
    UsageError
        Where there is no letter and no digit in it.
    """
    found = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")[:LONGEST].rstrip("_")
    if not found:
        raise UsageError(f"the model is called `{name}`, which has no letter that C allows in a name", "give the study another name")
    first = found.lower().partition("_")[0]
    return f"model_{found}" if first[0].isdigit() or first == "x" or found.lower() in RESERVED else found


def names_of_inputs(inputs: Sequence[Quantity], functions: Sequence[str] = ()) -> dict[str, str]:
    """Return what each input is called in code beside some `functions`, by its name."""
    names = [quantity.name for quantity in inputs]
    return dict(zip(names, identifiers(names, [*PYTHON, *functions, *(f"x_{name}" for name in names)]), strict=True))


def renamed(names: Mapping[str, str]) -> Iterator[str]:
    """Return a line for each input that is called otherwise here."""
    return (f"The input {name} is called {other} here." for name, other in names.items() if name != other)
