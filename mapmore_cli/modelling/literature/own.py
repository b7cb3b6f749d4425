"""Define the formulas that a user writes in a spec. Such a formula is an expression with its
parameters. It is stored as a text with the fit and in the model file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from mapmore_cli.domain.declared import Settings
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.expressions import ExpressionError, parse
from mapmore_cli.modelling.literature.formula import RANDOM, Formula
from mapmore_cli.modelling.literature.problem import Nonlinear


@dataclass(frozen=True, kw_only=True)
class FamilySettings(Settings):
    """The quantity in which the specimens of a family differ, and how their largest force depends
    on it.

    - `of`: The quantity, with one value for each specimen. Example: `rest_length`
    - `scale`: How the largest force depends on the quantity l. `saturating` is `a atan(b (l - 7.5
      mm))`, for a length that includes 7.5 mm of fittings. `power` is `a l^b`. Example: `power`
    """

    of: str
    scale: Literal["saturating", "power"] = "saturating"

    def definition(self, metres: float) -> str:
        """Return the definition of the family as a text, which is stored with its fit. `metres` is
        the length, in m, of one unit of the quantity `of`; it is 1 for a quantity that is no
        length.
        """
        return json.dumps({"family": {**vars(self), "metres": metres}}, sort_keys=True)


def is_family(name: str) -> bool:
    """Return True if `name` is the definition of a family instead of the name of a formula."""
    return name.startswith('{"family"')


NEAREST = 1e-4
"""Smallest magnitude that is searched if the bounds have different signs, as a fraction of the
larger bound.
"""

LONGEST = 100_000
"""Largest number of characters of a definition."""


def is_definition(name: str) -> bool:
    """Return True if `name` is the definition of a formula instead of the name of a formula."""
    return name.startswith("{")


def definition(
    name: str,
    reference: str,
    text: str,
    bounds: dict[str, tuple[float, float] | None],
    units: dict[str, str],
) -> str:
    """Return the definition as canonical JSON. `bounds` has an entry for every parameter; the entry
    is None for a parameter in which the formula is linear.
    """
    document = {
        "name": name,
        "reference": reference,
        "text": text,
        "bounds": bounds,
        "units": units,
    }
    return json.dumps(document, sort_keys=True)


@lru_cache(maxsize=256)
def formula_of(text: str) -> Formula:
    """Return the formula that a definition describes.

    Raises ValueError for a text that defines no formula, and ExpressionError for a malformed
    expression.
    """
    if len(text) > LONGEST:
        raise ValueError(f"the definition has {len(text)} characters; the limit is {LONGEST}")
    try:
        document = json.loads(text)
        parameters = tuple(document["bounds"])
        expression = parse(str(document["text"]))
        return Formula(
            name=str(document["name"]),
            reference=str(document["reference"]),
            inputs=tuple(sorted(expression.names - {*parameters})),
            parameters=parameters,
            text=str(document["text"]),
            nonlinear=tuple(
                Nonlinear(name, per=None, intervals=tuple(_intervals(*map(float, ends))))
                for name, ends in document["bounds"].items()
                if ends is not None
            ),
            start=RANDOM,
            units={str(name): str(unit) for name, unit in document["units"].items()},
            definition=text,
        ).checked()
    except ExpressionError:
        raise
    except (KeyError, TypeError, AttributeError, RecursionError, OverflowError) as error:
        raise ValueError(
            f"the text is no valid definition of a formula: {type(error).__name__}: {error}"
        ) from error


def units_of_parameters(fit: FormulaFit) -> Mapping[str, str]:
    """Return the units of the parameters of a formula that the spec defines. For a formula of the
    literature, the result is empty.
    """
    return (
        formula_of(fit.definition).units if fit.definition and not is_family(fit.definition) else {}
    )


def _intervals(low: float, high: float) -> Iterator[tuple[float, float]]:
    """Yield the negative and the positive part of the interval between the bounds. If the interval
    contains zero, the values next to zero are left out, because the search multiplies values by
    factors and so cannot change their sign.
    """
    least = NEAREST * max(-low, high)
    if low < 0:
        yield low, high if high < 0 else -least
    if high > 0:
        yield low if low > 0 else least, high
