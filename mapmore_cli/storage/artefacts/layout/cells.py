"""Codecs that the stored types have in common. Numbers are finite, except where the name says that they may be NaN or infinite."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import ExpressionError, parse
from mapmore_cli.storage.artefacts.codecs import adapted, named, number, numbers, optional, shown, text, texts
from mapmore_cli.storage.artefacts.integrity import Invalid
from mapmore_cli.storage.artefacts.schema import Fault

TEXT, REAL, COUNT = text(), number(float), number(int, least=0)
NAME = text(pattern=r"[A-Za-z_][A-Za-z0-9_]*")
ANY_REAL = number(float, may_be_nan=True)
SHARE = number(float, least=0, most=1)
OPTIONAL_TEXT = optional(TEXT)
TEXTS = texts()
REALS, ANY_REALS, ANY_TABLE, TABLE = (
    numbers("<f8"),
    numbers("<f8", may_be_nan=True),
    numbers("<f8", ndim=2, may_be_nan=True),
    numbers("<f8", ndim=2),
)
ASCENDING = numbers("<f8", ascending=True)
INDICES = numbers("<i8", least=0)
FLAGS = numbers("|u1", load_dtype="bool")  # not HDF5's enumeration, which MATLAB reads as text
FLAG = adapted(COUNT, store=int, load=bool)
CELL = adapted(numbers("<i8", least=1), store=list, load=lambda array: tuple(array.tolist()))


def _is_pair(pair: tuple[float, ...], where: str) -> None:
    if len(pair) != 2:
        raise Invalid(where, f"has {len(pair)} values, where two belong")


def _is_span(span: tuple[float, ...], where: str) -> None:
    if len(span) != 2 or span[0] > span[1]:
        raise Invalid(where, "is not a least and a greatest value")


def _are_cuts(boundaries: Array, where: str) -> None:
    if len(boundaries) != 2 or boundaries[0] > boundaries[1]:  # a curve that was measured at one place has one segment, from there to there
        ASCENDING.check(boundaries, where, {})


SPAN = adapted(REALS, store=list, load=lambda array: tuple(array.tolist()), check=_is_span)
PAIR = adapted(REALS, store=list, load=lambda array: tuple(array.tolist()), check=_is_pair)
CUTS = adapted(REALS, store=np.asarray, load=np.asarray, check=_are_cuts)
LIMITS = named(SPAN)


def expression_faults(field: str, expressions: Iterable[str], known: Iterable[str]) -> Iterator[Fault]:
    """Yield what is wrong with texts that are to be expressions of `known` names."""
    names = frozenset(known)
    for expression in expressions:
        try:
            strange = sorted(parse(expression).names - names)
        except ExpressionError as error:
            yield field, f"has {shown(expression)}, which is no term: {error}"
        else:
            if strange:
                yield field, f"has {shown(expression)}, but nothing is known of {shown(strange[0])}"
