"""Define the `dictionary` section of a spec, which lists kinds of candidate terms, with and without
memory. In the code, the settings of a kind of terms are called a family.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, create_model

from mapmore_cli.domain.declared import Either, ListToo, OfTarget, always_in
from mapmore_cli.modelling.expressions import ExpressionError, parse, state
from mapmore_cli.modelling.expressions.operator import Operator
from mapmore_cli.modelling.expressions.operators import OPERATORS, families
from mapmore_cli.study.fields import Row, Section
from mapmore_cli.study.tree import Loc, quoted

Of = Annotated[list[str], Field(min_length=1)]
"""Names of quantities or of states, for example `play(pressure, 0.16)`."""
Count = Annotated[int, Field(ge=1, le=100)]


class OperatorFamily(Section):
    """Settings of an operator with memory, such as `slow` or `play`. The operator computes states
    from some quantities; a state is a signal that can depend on past samples. If a parameter of the
    operator is not given, training estimates it.

    - `of`: The quantities, or states such as `play(pressure, 0.16)`. Example: `[pressure]`
    """

    of: Of

    def _contradictions(self) -> Sequence[Row]:
        keys = [key for key in type(self).model_fields if getattr(self, key) is not None]
        either = f"give either {quoted(keys[1:], ' or ')}"
        return [(len(keys) > 2, either, "remove one of them", keys[-1])]


def _forms() -> Iterator[tuple[str, type[OperatorFamily]]]:
    """Yield the key of each operator in a dictionary, for example `slow`, and the class of its
    settings. Operators whose settings have the same keys have the same class.
    """
    shapes: dict[tuple[Any, ...], list[str]] = {}
    for key, (operator, *_) in families().items():
        shape = (*operator.parameters, operator.spread) if len(operator.parameters) == 1 else ()
        shapes.setdefault(shape, []).append(key)
    for shape, keys in shapes.items():
        about = "\n".join(
            [*map(_about_family, keys), *(_about_numbers(families()[keys[0]][0], shape))]
        )
        form = create_model(
            "".join(key.title() for key in keys) if shape else "Operators",
            __base__=OperatorFamily,
            __doc__=f"States that an operator computes from the quantities in `of`.\n\n{about}",
            __module__=__name__,
            **_number_fields(families()[keys[0]][0]) if shape else {},
        )
        yield from ((key, form) for key in keys)


def _about_family(key: str) -> str:
    return f"- `{key}`: {families()[key][0].summary} Example: `{{of: [pressure]}}`"


def _about_numbers(operator: Operator, shape: tuple[Any, ...]) -> Iterator[str]:
    """Yield lines of a docstring, which describe the keys that `_number_fields` makes."""
    for parameter in operator.parameters if shape else ():
        yield (
            f"- `{parameter.key}`: Parameter of each state; there are as many states as numbers. "
            f"Example: `[{parameter.example}]`"
        )
    if shape and operator.spread is not None:
        yield (
            "- `count`: Number of states, with parameters spread over the range that the "
            "recordings can show. Example: `4`"
        )


def _number_fields(operator: Operator) -> dict[str, Any]:
    """Return the fields for the parameter of an operator that has exactly one parameter: a list of
    values and, if the operator can choose values itself, the number of values (`count`).
    """
    (parameter,) = operator.parameters
    lower = Field(ge=parameter.above) if parameter.or_zero else Field(gt=parameter.above)
    upper = Field(lt=None if parameter.below == inf else parameter.below)
    unit_of = always_in(parameter.unit)
    number: Any = Annotated[float, lower, upper, unit_of]
    fields: dict[str, Any] = {
        parameter.key: (Annotated[list[number], Field(min_length=1)] | None, None)
    }
    return {**fields, "count": (Count | None, None)} if operator.spread is not None else fields


FORMS: Mapping[str, type[OperatorFamily]] = dict(_forms())
"""Class of each operator's family, by key."""


def numbers_of(
    name: str, family: OperatorFamily, step: float, longest: float
) -> Sequence[tuple[float, ...]]:
    """Return the parameter values of each state that an operator makes. Return an empty sequence if
    training estimates the parameters.

    `step` is the time between samples, s; `longest` is the duration of the longest piece of a
    recording, s.
    """
    operator, count = families()[name][0], getattr(family, "count", None)
    numbers = getattr(family, operator.parameters[0].key, None)
    if count is not None and operator.spread is not None:
        numbers = operator.spread(count, step, longest)
    return [(number,) for number in numbers or ()]


Order = Annotated[int, Field(ge=1, le=20)]
Steps = Annotated[int, Field(ge=0, le=1_000_000)]


class Polynomial(Section):
    """All monomials of some quantities up to a total degree.

    - `of`: The quantities. Example: `[strain, pressure]`
    - `order`: Largest total degree. A higher order can follow more bends of a curve, but overfits
      sooner. Example: `4`
    - `constant`: If false, leave out the constant term. Example: `false`
    """

    of: Of
    order: Order
    constant: bool = True


class Lags(Section):
    """Values of quantities some samples ago, for example `force[k-1]`, and their monomials.

    - `of`: The quantities. Example: `[pressure, force]`
    - `steps`: How many samples ago the values are taken; 0 means the present sample. Example: `[0,
      1, 2]`
    - `order`: Largest total degree of the monomials. Example: `2`
    - `constant`: If false, leave out the constant term. Example: `false`
    """

    of: Of
    steps: Annotated[list[Steps], Field(min_length=1)]
    order: Order = 1
    constant: bool = True


Widths = Annotated[list[Annotated[float, Field(gt=0), always_in("1")]], Field(min_length=1)]
"""Widths as fractions of the training range of an input."""
Window = Annotated[int, Field(ge=1, le=1_000_000)]


class AlongRange(Section):
    """Functions of one input that are defined by its training range. Each function is a candidate
    term. The product of each function with each factor in `with` is a candidate term, too.

    - `of`: The input. Example: `strain`
    - `with`: The quantities by which each function is also multiplied. Example: `[pressure]`
    """

    of: str
    partners: list[str] = Field(default=[], alias="with")

    @property
    def functions(self) -> list[str]:
        """The functions as texts of expressions, for example `exp(-unit(strain/0.1))`. In
        `unit(...)`, the input is replaced by its position in the training range, from 0 to 1.
        """
        raise NotImplementedError


class Spline(AlongRange):
    """Cubic spline of one input, and its products with each factor in `with`.

    - `knots`: Number of knots, evenly spaced inside the training range. More knots follow finer
      details. Example: `9`
    """

    knots: Annotated[int, Field(ge=2, le=100)]

    @property
    def functions(self) -> list[str]:
        """Terms of the spline: powers of the input, and the cubed distances of the input from the
        knots. With these distances, the fit is better conditioned than with truncated powers.
        """
        places = [round(place / (self.knots + 1), 4) for place in range(1, self.knots + 1)]
        return [
            "1",
            self.of,
            f"{self.of}^2",
            f"{self.of}^3",
            *(f"abs(unit({self.of} - {place}))^3" for place in places),
        ]


class Ends(AlongRange):
    """Exponential functions that decay from both ends of the training range of an input, and their
    products with each factor in `with`.

    - `widths`: Decay lengths of the exponentials, as fractions of the range. Example: `[0.03, 0.1,
      0.3]`
    """

    widths: Widths

    @property
    def functions(self) -> list[str]:
        """The exponentials as texts of expressions. For each width, the first decays from the lower
        end of the training range, and the second from the upper end.
        """
        return [
            text
            for width in self.widths
            for text in (f"exp(-unit({self.of}/{width}))", f"exp(unit(({self.of} - 1)/{width}))")
        ]


class SmoothSteps(AlongRange):
    """Smooth steps (tanh) at evenly spaced places of the training range of an input, and their
    products with each factor in `with`.

    - `count`: Number of places. Example: `21`
    - `widths`: Widths of the steps, as fractions of the range. Example: `[0.03, 0.1]`
    - `window`: Number of samples over which the factor `change` is computed. `change` in `with`
      stands for the change of the input within this window, and for its square. Example: `16`
    """

    count: Annotated[int, Field(ge=2, le=100)]
    widths: Widths
    window: Annotated[Window | Annotated[list[Window], Field(min_length=1)], Either()] | None = None

    @property
    def functions(self) -> list[str]:
        """The steps as texts of expressions, from the lower end of the training range to the upper
        end.
        """
        places = [round(place / (self.count - 1), 4) for place in range(self.count)]
        return [
            f"tanh(unit(({self.of} - {place})/{width}))"
            for place in places
            for width in self.widths
        ]

    def _contradictions(self) -> Sequence[Row]:
        return [
            (
                ("change" in self.partners) == (self.window is None),
                "`window` and `change` must be used together",
                "write `with: [change], window: 16`, or remove both",
                "window",
                "with",
            )
        ]


class Products(Section):
    """All products of terms of other kinds, up to a total degree.

    - `of`: The kinds of terms, or names of states. Example: `[{slow: {of: [pressure]}}, strain]`
    - `order`: Largest total degree of a product. Example: `2`
    - `with`: Some of the names in `of`. Each product then consists of powers of these names and of
      at most one other term. This keeps the number of products small. Example: `[strain]`
    - `constant`: If false, leave out the constant term. Example: `false`
    """

    of: Annotated[list[Annotated[str | DictionaryEntry, Either()]], Field(min_length=1)]
    order: Order
    partners: Of | None = Field(default=None, alias="with")
    constant: bool = True


Family = Polynomial | Lags | OperatorFamily | AlongRange | Products | list[str]
"""One kind of term with its settings; a list of texts is the kind `terms`."""


LIMITS = ("sign", "bounds")
"""Keys of an entry that limit the coefficients of its terms."""


class Families(Section):
    """The kinds of terms that are not made by an operator.

    - `polynomial`: Monomials of some quantities. Example: `{of: [strain], order: 4}`
    - `terms`: Terms that are written out as expressions. Example: `[strain^2, "exp(-strain/0.02)"]`
    - `lags`: Values of quantities some samples ago. Example: `{of: [force], steps: [1, 2]}`
    - `products`: Products of the terms of other kinds. Example: `{of: [{slow: {of: [pressure]}},
      strain], order: 2}`
    - `spline`: A cubic spline along the training range of an input. Example: `{of: strain, knots:
      9}`
    - `ends`: Exponential functions that decay from both ends of the training range. Example: `{of:
      strain, widths: [0.03, 0.1]}`
    - `steps`: Smooth steps along the training range. Example: `{of: voltage, count: 21, widths:
      [0.1]}`
    - `sign`: Sign that the coefficients of the terms of this entry must have. The inputs are scaled
      as `fit.scaling` says. `sign` and `bounds` are not possible with memory, nor for `spline`,
      `ends` and `steps`. Example: `negative`
    - `bounds`: Smallest and largest value of the coefficients of the terms of this entry, in the
      unit of the target. Example: `[0, 5 N]`
    """

    polynomial: Polynomial | None = None
    terms: Annotated[list[str], Field(min_length=1)] | None = None
    lags: Lags | None = None
    products: Products | None = None
    spline: Spline | None = None
    ends: Ends | None = None
    steps: SmoothSteps | None = None
    sign: Literal["positive", "negative"] | None = None
    bounds: Annotated[tuple[OfTarget, OfTarget], ListToo()] | None = None

    def _given(self) -> dict[str, Family]:
        return {
            name: family
            for name in type(self).model_fields
            if name not in LIMITS and (family := getattr(self, name)) is not None
        }

    @property
    def bounded(self) -> bool:
        """Return True if `sign` or `bounds` limits the coefficients."""
        return self.sign is not None or self.bounds is not None

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest coefficient of the terms of an entry with `sign` or `bounds`, in the
        unit of the target.
        """
        if self.bounds is not None:
            return self.bounds
        assert self.sign is not None
        return {"positive": (0.0, inf), "negative": (-inf, 0.0)}[self.sign]

    @property
    def family(self) -> tuple[str, Family]:
        """Name and settings of the kind of term in this entry."""
        return next(iter(self._given().items()))

    def _contradictions(self) -> Sequence[Row]:
        low, high = self.bounds or (-inf, inf)
        count = "two kinds" if self._given() else "no kind"
        names = quoted(name for name in type(self).model_fields if name not in LIMITS)
        return [
            (
                self.sign is not None and self.bounds is not None,
                "`sign` and `bounds` are both given, and a sign is a bound too",
                "remove one of them",
                "sign",
            ),
            (
                not low <= high,
                "the lower bound is above the upper bound",
                "put the lower bound first",
                "bounds",
            ),
            (
                len(self._given()) != 1,
                f"this entry has {count} of terms",
                f"write one of {names}; write further kinds as further entries",
            ),
        ]


if TYPE_CHECKING:

    class DictionaryEntry(Families):
        """One kind of candidate terms."""

else:
    DictionaryEntry = create_model(
        "DictionaryEntry",
        __base__=Families,
        __doc__=(
            "One kind of candidate terms: monomials, states with memory, products of both, "
            "or expressions under the key `terms`.\n\n" + "\n".join(map(_about_family, FORMS))
        ),
        __module__=__name__,
        **{key: (form | None, None) for key, form in FORMS.items()},
    )


def entries_of(
    entries: Sequence[str | DictionaryEntry], loc: Loc = ("dictionary",)
) -> Iterator[tuple[Loc, str, Family]]:
    """Yield each entry of a dictionary: its path, the name of its kind of terms, and its settings.
    Entries inside products are included.
    """
    for place, entry in enumerate(entries):
        if isinstance(entry, DictionaryEntry):
            name, family = entry.family
            yield (*loc, place, name), name, family
            if isinstance(family, Products):
                yield from entries_of(family.of, (*loc, place, name, "of"))


def texts_in(loc: Loc, family: Family) -> Iterator[tuple[Loc, str, bool]]:
    """Yield each text in the settings `family` of a kind of terms that contains names of quantities
    or states. Yield its path, the text, and a flag: True if the text is an expression, False if it
    is the name of a state. `loc` is the path of the settings. Kinds of terms inside products are
    left out.
    """
    if isinstance(family, list):
        yield from (((*loc, place), text, True) for place, text in enumerate(family))
        return
    is_along = isinstance(family, AlongRange)
    if isinstance(family, AlongRange):
        yield (*loc, "of"), family.of, False
    else:
        for place, text in enumerate(family.of):
            if isinstance(text, str):
                yield (*loc, "of", place), text, False
    of_window = "change" if getattr(family, "window", None) else ""
    for place, text in enumerate(getattr(family, "partners", None) or ()):
        if not (is_along and text == of_window):
            yield (*loc, "with", place), text, is_along


STATIC = ("polynomial", "terms", "products", "spline", "ends", "steps")
"""Kinds of terms that need only the present sample, unless a state that they name needs more."""


def timed_terms(dictionary: Sequence[DictionaryEntry]) -> tuple[str, ...]:
    """Return the names of the kinds of terms, and of the states, for which time steps must be
    equal. They count samples (as `lags` do), or use the time between samples (as `slow` does).
    Other kinds of terms, such as `play`, need only the order of the samples.
    """
    names: dict[str, None] = {}
    for loc, name, family in entries_of(dictionary):
        is_timed = OPERATORS[name].timed if name in OPERATORS else name not in STATIC
        if is_timed or getattr(family, "window", None):
            names[name] = None
        names |= dict.fromkeys(
            used for used in sorted(_names_of(loc, family)) if not state(used).goes_by_order
        )
    return tuple(names)


def remembers(dictionary: Sequence[DictionaryEntry]) -> bool:
    """Return True if any term has memory: it needs other samples of a recording than the present
    one.
    """
    return any(
        name not in STATIC
        or getattr(family, "window", None)
        or any(not used.isidentifier() for used in _names_of(loc, family))
        for loc, name, family in entries_of(dictionary)
    )


def feeds_back(dictionary: Sequence[DictionaryEntry], target: str) -> bool:
    """Return True if any term uses the target."""
    return any(
        state(used).quantity == target
        for loc, _, family in entries_of(dictionary)
        for used in _names_of(loc, family)
    )


def _names_of(loc: Loc, family: Family) -> Iterator[str]:
    for _, text, _ in texts_in(loc, family):
        yield from names_in(text)


def names_in(text: str) -> frozenset[str]:
    """Return the names of the quantities and states in a text, which is an expression or the name
    of a state. If the text cannot be read, the result is empty, because another check reports this.
    """
    try:
        return frozenset(parse(text).names)
    except ExpressionError:
        return frozenset()
