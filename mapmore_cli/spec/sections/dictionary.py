"""The `dictionary` section of an experiment: families of candidate terms, with and without memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Annotated

from pydantic import Field, model_validator

from mapmore_cli.spec.fields import Hertz, Keyed, Seconds, Section, Text, WithUnit, by_shape, contradiction
from mapmore_cli.spec.tree import Loc

Of = Annotated[list[str], Field(min_length=1)]
"""Names of quantities, or of states as `play(pressure, 0.16)`."""
Order = Annotated[int, Field(ge=1, le=20)]
Count = Annotated[int, Field(ge=1, le=100)]
Steps = Annotated[int, Field(ge=0, le=1_000_000)]
Width = Annotated[float, Field(gt=0, lt=1), WithUnit(lambda _: "1")]


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


class Slow(Section):
    """First-order lags of the quantities `of`, with time constants `tau`, or a `count` of them spread over what the recordings can show."""

    of: Of
    tau: Annotated[list[Seconds], Field(min_length=1)] | None = None
    count: Count | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Slow:
        if (self.tau is None) == (self.count is None):
            raise contradiction("`slow` takes either `tau` or `count`", "give one of both, as `tau: [50 ms, 0.5 s]`", "count", "of")
        return self


class Widths(Section):
    """`play` or `stop` operators on the quantities `of`.

    `widths` are half the slack as fractions of the training range; a `count` of them is spread evenly.
    """

    of: Of
    widths: Annotated[list[Width], Field(min_length=1)] | None = None
    count: Count | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Widths:
        if (self.widths is None) == (self.count is None):
            raise contradiction("an operator takes either `widths` or `count`", "give one of both, as `widths: [0.1, 0.3]`", "count", "of")
        return self


class Resonance(Section):
    """Position and velocity of a damped oscillator that each quantity `of` drives; `frequency` and `damping` are found where not given."""

    of: Of
    frequency: Hertz | None = None
    damping: Annotated[float, Field(gt=0, lt=1), WithUnit(lambda _: "1")] | None = None

    @model_validator(mode="after")
    def _both_or_none(self) -> Resonance:
        if (self.frequency is None) != (self.damping is None):
            missing = "frequency" if self.frequency is None else "damping"
            remedy = f"add `{missing}`, or leave both out: training then finds them"
            raise contradiction(f"`resonance` lacks `{missing}`", remedy, "frequency", "damping")
        return self


class Saturate(Section):
    """The quantities `of`, held at the ends of their training range."""

    of: Of


class Products(Section):
    """Every product of the terms `of` families (or of states by name) with total degree up to `order`, as `polynomial`.

    Given `with`, names among `of`, a product holds powers of at most one term besides those.
    """

    of: Annotated[list[Annotated[Annotated[str, Text] | Annotated[DictionaryEntry, Keyed], by_shape]], Field(min_length=1)]
    order: Order
    partners: Of | None = Field(default=None, alias="with")
    constant: bool = True


Family = Polynomial | Lags | Delays | Slow | Widths | Resonance | Saturate | Products | list[str]
"""One family of terms; a list holds expressions."""


class DictionaryEntry(Section):
    """One family of candidate terms: monomials, states with memory, products of both, or `terms` written out as expressions."""

    polynomial: Polynomial | None = None
    terms: Annotated[list[str], Field(min_length=1)] | None = None
    lags: Lags | None = None
    delays: Delays | None = None
    slow: Slow | None = None
    play: Widths | None = None
    stop: Widths | None = None
    resonance: Resonance | None = None
    saturate: Saturate | None = None
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
    def _one_family(self) -> DictionaryEntry:
        if len(self.families) != 1:
            found = "two families" if self.families else "no family"
            remedy = f"give one of {', '.join(f'`{name}`' for name in type(self).model_fields)}; further families are entries of their own"
            raise contradiction(f"this entry has {found} of terms", remedy)
        return self


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


def _has_memory(text: str) -> bool:
    """Whether an expression or the name of a state has memory; text that is neither is reported elsewhere."""
    from mapmore_cli.modelling.terms import ExpressionError, parse

    try:
        return any(not name.isidentifier() for name in parse(text).names)
    except ExpressionError:
        return False
