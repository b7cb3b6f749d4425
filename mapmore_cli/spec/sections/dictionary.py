"""The `dictionary` section of an experiment: families of candidate terms, with and without memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, create_model, model_validator

from mapmore_cli.spec.fields import Keyed, Seconds, Section, Text, by_shape, contradiction
from mapmore_cli.spec.sections.operators import FORMS, Of, OperatorFamily
from mapmore_cli.spec.tree import Loc

Order = Annotated[int, Field(ge=1, le=20)]
Steps = Annotated[int, Field(ge=0, le=1_000_000)]


class Polynomial(Section):
    """Every monomial of the quantities `of` with total degree up to `order`, the constant included unless `constant: false`."""

    of: Of
    order: Order
    constant: bool = True


class Lags(Section):
    """Every monomial of the quantities `of`, so many samples ago (`steps`, 0 is now), as `force[k-1]`; up to `order`, as `polynomial`."""

    of: Of
    steps: Annotated[list[Steps], Field(min_length=1)]
    order: Order = 1
    constant: bool = True


class Delays(Section):
    """The quantities `of`, so much time ago (`times`), to the nearest sample."""

    of: Of
    times: Annotated[list[Seconds], Field(min_length=1)]


class Products(Section):
    """Every product of the terms `of` families (or of states by name) with total degree up to `order`, as `polynomial`.

    Given `with`, names among `of`, a product holds powers of at most one term besides those.
    """

    of: Annotated[list[Annotated[Annotated[str, Text] | Annotated[DictionaryEntry, Keyed], by_shape]], Field(min_length=1)]
    order: Order
    partners: Of | None = Field(default=None, alias="with")
    constant: bool = True


Family = Polynomial | Lags | Delays | OperatorFamily | Products | list[str]
"""One family of terms; a list holds expressions."""


class Families(Section):
    """The families that are no operator's."""

    polynomial: Polynomial | None = None
    terms: Annotated[list[str], Field(min_length=1)] | None = None
    lags: Lags | None = None
    delays: Delays | None = None
    products: Products | None = None

    @property
    def families(self) -> Mapping[str, Family]:
        """What is given, by name; one in a valid entry."""
        given = {name: getattr(self, name) for name in type(self).model_fields}
        return MappingProxyType({name: family for name, family in given.items() if family is not None})

    @property
    def family(self) -> tuple[str, Family]:
        """Name and settings."""
        return next(iter(self.families.items()))

    @model_validator(mode="after")
    def _one_family(self) -> Families:
        if len(self.families) != 1:
            found = "two families" if self.families else "no family"
            remedy = f"give one of {', '.join(f'`{name}`' for name in type(self).model_fields)}; further families are entries of their own"
            raise contradiction(f"this entry has {found} of terms", remedy)
        return self


if TYPE_CHECKING:

    class DictionaryEntry(Families):
        """One family of candidate terms."""

else:
    DictionaryEntry = create_model(
        "DictionaryEntry",
        __base__=Families,
        __doc__="One family of candidate terms: monomials, states with memory, products of both, or `terms` written out as expressions.",
        __module__=__name__,
        **{key: (form | None, None) for key, form in FORMS.items()},
    )


def entries_of(dictionary: Sequence[DictionaryEntry], loc: Loc = ("dictionary",)) -> Iterator[tuple[Loc, str, Family]]:
    """Place, name and settings of every family, those inside products included."""
    for place, entry in enumerate(dictionary):
        yield from _of_entry(entry, (*loc, place))


def _of_entry(entry: DictionaryEntry, loc: Loc) -> Iterator[tuple[Loc, str, Family]]:
    name, family = entry.family
    yield (*loc, name), name, family
    for place, inner in enumerate(family.of if isinstance(family, Products) else ()):
        if isinstance(inner, DictionaryEntry):
            yield from _of_entry(inner, (*loc, name, "of", place))


def texts_in(loc: Loc, family: Family) -> Iterator[tuple[Loc, str, bool]]:
    """Place and text of all in a family, which stands at `loc`, that names quantities: expressions (True), and names of states (False).

    Families inside it are left out.
    """
    if isinstance(family, list):
        yield from (((*loc, place), text, True) for place, text in enumerate(family))
        return
    yield from (((*loc, "of", place), text, False) for place, text in enumerate(family.of) if isinstance(text, str))
    partners = family.partners if isinstance(family, Products) else None
    yield from (((*loc, "with", place), text, False) for place, text in enumerate(partners or ()))


def remembers(dictionary: Sequence[DictionaryEntry]) -> bool:
    """Whether any term needs more of a recording than the sample itself."""
    plain = {"polynomial", "terms", "products"}
    for loc, name, family in entries_of(dictionary):
        if name not in plain or any(_has_memory(text) for _, text, _ in texts_in(loc, family)):
            return True
    return False


def feeds_back(dictionary: Sequence[DictionaryEntry], target: str) -> bool:
    """Whether any term is made of the target."""
    texts = [text for loc, _, family in entries_of(dictionary) for _, text, _ in texts_in(loc, family)]
    return any(quantity == target for text in texts for quantity in _quantities(text))


def _quantities(text: str) -> list[str]:
    """Quantities that an expression or a state is made of; text that is neither is reported elsewhere."""
    from mapmore_cli.modelling.terms import ExpressionError, parse, state

    try:
        return [state(name).quantity for name in parse(text).names]
    except ExpressionError:
        return []


def _has_memory(text: str) -> bool:
    """Whether an expression or the name of a state has memory; text that is neither is reported elsewhere."""
    from mapmore_cli.modelling.terms import ExpressionError, parse

    try:
        return any(not name.isidentifier() for name in parse(text).names)
    except ExpressionError:
        return False
