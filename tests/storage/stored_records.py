"""Random instances of every stored type, and equality that knows arrays and NaN."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmore_cli.domain.fits import FormulaFit, Scaling, Segment, SegmentedCurve, SegmentFit, Selection
from mapmore_cli.domain.memory import MemoryModel, StateSet
from mapmore_cli.domain.models import (
    CurveFunction,
    CurveRange,
    FoldError,
    Formula,
    Fusion,
    Memory,
    Model,
    Part,
    Pieces,
    SegmentFunction,
    Sum,
)
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.domain.scores import Score, Validation

NAMES = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=8) | st.sampled_from(
    ["strain", "pressure=150/strain:2", ".", "..", "a/b", "%2F", "ü μ", "order"]
)
UNITS = st.sampled_from(["kPa", "1", "N", "kPa/s", "m"])
REAL = st.floats(width=64)
COUNT = st.integers(0, 2**40)
NOTES = st.lists(NAMES, max_size=2).map(tuple)


def reals(*shape: int) -> st.SearchStrategy[Any]:
    return arrays(np.float64, shape, elements=REAL)


def whole(*shape: int) -> st.SearchStrategy[Any]:
    return arrays(np.int64, shape, elements=st.integers(-1, 2**40))


def some(strategy: st.SearchStrategy[Any], most: int = 2) -> st.SearchStrategy[Any]:
    return st.lists(strategy, max_size=most).map(tuple)


def table(values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.dictionaries(NAMES, values, max_size=3)


def columns(size: int) -> st.SearchStrategy[Any]:
    return table(reals(size))


QUANTITIES = st.builds(Quantity, NAMES, UNITS)
RECORDINGS = st.integers(0, 5).flatmap(lambda n: st.builds(Recording, NAMES, NAMES, columns(n), COUNT, table(COUNT)))
CURVES = st.integers(0, 5).flatmap(
    lambda n: st.builds(
        Curve, NAMES, st.none() | REAL, columns(n), arrays(np.bool_, n), NOTES, st.none() | arrays(np.bool_, n), st.none() | whole(n)
    )
)


@st.composite
def datasets(draw: st.DrawFn) -> Dataset:
    quantities = draw(table(QUANTITIES))
    level = draw(st.none() | st.sampled_from([*quantities])) if quantities else None
    return Dataset(draw(NAMES), level, quantities, draw(some(RECORDINGS)), draw(some(CURVES)), draw(NOTES))


DATASETS = datasets()

CELLS = some(st.integers(1, 9))
LIMITS = table(st.tuples(REAL, REAL))
SEGMENTS = st.builds(Segment, NAMES, NAMES, CELLS, st.integers(0, 4).flatmap(whole))
BOUNDARIES = some(st.integers(0, 4).flatmap(reals))
SEGMENTATIONS = some(st.builds(SegmentedCurve, NAMES, st.none() | REAL, NOTES, BOUNDARIES, LIMITS, some(SEGMENTS)))

SCALINGS = st.integers(0, 3).flatmap(lambda n: st.builds(Scaling, NAMES, NAMES, NOTES, reals(n), reals(n), REAL, REAL))


@st.composite
def segment_fits(draw: st.DrawFn) -> SegmentFit:
    m = draw(st.integers(1, 5))
    k = draw(st.integers(0, m))
    selection = Selection(
        chosen=np.array(draw(st.permutations(range(m)))[:k], dtype=np.int64),
        g=draw(reals(k)),
        err=draw(arrays(np.float64, k, elements=st.floats(0, 1) | st.just(np.nan))),
        theta=draw(reals(k)),
        theta_error=draw(reals(k)),
        a=draw(reals(k, k)),
        g_all=draw(reals(k, m)),
        err_all=draw(reals(k, m)),
        runner_up=draw(whole(k)),
        tied=draw(whole(k)),
        condition=draw(REAL),
        sse=draw(REAL),
        yy=draw(REAL),
        samples=draw(COUNT),
        stop=draw(NAMES),
    )
    candidates = tuple(draw(st.lists(NAMES, min_size=m, max_size=m)))
    return SegmentFit(draw(NAMES), draw(NAMES), draw(CELLS), candidates, draw(SCALINGS), selection)


FORMULAS = st.builds(FormulaFit, NAMES, table(REAL), table(REAL), NAMES, NAMES, COUNT, REAL, REAL, COUNT, NOTES)
FITS = st.builds(FitResult, st.none() | FORMULAS | st.builds(PiecesFit, some(segment_fits())), st.none() | FORMULAS, NOTES)

SIDE = st.sampled_from(["continue", "continue_linear", "saturate", "zero"]) | st.floats(allow_nan=False)
FUSIONS = st.builds(
    Fusion,
    st.sampled_from(["linear", "cubic"]),
    REAL,
    table(st.tuples(SIDE, SIDE)),
    st.sampled_from(["linear", "pchip"]),
    st.none() | NAMES,
    st.floats(0, 1),
)
FUNCTIONS = st.integers(0, 3).flatmap(
    lambda k: st.builds(SegmentFunction, NAMES, CELLS, NOTES, reals(k), reals(k), reals(k), reals(k), SCALINGS, COUNT, REAL, NAMES, LIMITS)
)
CURVE_FUNCTIONS = st.builds(CurveFunction, NAMES, st.none() | REAL, BOUNDARIES, LIMITS, some(FUNCTIONS), st.none() | REAL)
RANGES = some(st.builds(CurveRange, NAMES, st.none() | REAL, LIMITS))
FOLDS = some(st.builds(FoldError, NAMES, REAL, COUNT))
PIECES = st.builds(Pieces, st.none() | NAMES, NOTES, some(CURVE_FUNCTIONS), FUSIONS, st.none() | FORMULAS, FOLDS)
STATES = st.integers(0, 3).flatmap(
    lambda s: st.builds(StateSet, st.tuples(*[NAMES] * s), REAL, LIMITS, LIMITS, reals(s) | reals(0), reals(s) | reals(0), REAL)
)
MEMORIES = st.builds(MemoryModel, NAMES, STATES, NOTES, reals(2), reals(2), REAL, st.tuples(REAL, REAL))


def models(bodies: st.SearchStrategy[Any]) -> st.SearchStrategy[Model]:
    """Models with some bodies."""
    return st.builds(Model, name=NAMES, output=QUANTITIES, inputs=some(QUANTITIES), body=bodies, notes=NOTES)


ALONE = PIECES | st.builds(Formula, FORMULAS, st.none() | NAMES, RANGES) | st.builds(Memory, MEMORIES, RANGES, st.none() | FORMULAS)
SUMS = st.builds(Sum, some(st.builds(Part, models(ALONE), st.sampled_from([1.0, -1.0]), table(NAMES))))
MODELS = models(ALONE | SUMS)

SCORES = st.builds(Score, NAMES, NAMES, NAMES, NAMES, COUNT, REAL, REAL, REAL, NAMES, REAL, REAL, REAL)
VALIDATIONS = st.builds(Validation, table(some(st.integers(0, 4).flatmap(reals))), table(FORMULAS), some(SCORES), table(UNITS))


def same(left: Any, right: Any) -> bool:
    """Equal in type and value, NaN equal to NaN, arrays by dtype and element, mappings with their order."""
    if type(left) is not type(right):
        return False
    if is_dataclass(left):
        return all(same(getattr(left, field.name), getattr(right, field.name)) for field in fields(left))
    if isinstance(left, Mapping):
        return list(left) == list(right) and all(same(left[key], right[key]) for key in left)
    if isinstance(left, tuple | list):
        return len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, np.ndarray):
        return left.dtype == right.dtype and np.array_equal(left, right, equal_nan=left.dtype.kind == "f")
    return bool(left == right or (left != left and right != right))
