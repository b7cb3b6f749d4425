"""Random instances of every stored type, and equality that knows arrays and NaN."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from itertools import product
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
    LeftOut,
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
from mapmore_cli.modelling import literature

NAMES = st.text(st.characters(exclude_categories=["Cs", "Cc", "Cf", "Zl", "Zp"]), max_size=8) | st.sampled_from(
    ["strain", "pressure=150/strain:2", ".", "..", "a/b", "%2F", "ü μ", "order"]
)
IDENTIFIERS = st.sampled_from(["strain", "pressure", "force", "_x1"])
UNITS = st.sampled_from(["kPa", "1", "N", "kPa/s", "m"])
FINITE = st.floats(allow_nan=False, allow_infinity=False)
REAL = st.floats(width=64)
POSITIVE = st.floats(1e-3, 1e3)
COUNT = st.integers(0, 2**40)
NOTES = st.lists(NAMES, max_size=2).map(tuple)


def reals(*shape: int) -> st.SearchStrategy[Any]:
    return arrays(np.float64, shape, elements=FINITE)


def any_reals(*shape: int) -> st.SearchStrategy[Any]:
    return arrays(np.float64, shape, elements=REAL)


def whole(n: int, below: int = 2**40, least: int = 0) -> st.SearchStrategy[Any]:
    return arrays(np.int64, n, elements=st.integers(least, below - 1)) if below > least else st.just(np.zeros(0, dtype=np.int64))


def ascending(n: int) -> st.SearchStrategy[Any]:
    return st.lists(st.integers(-1000, 1000), min_size=n, max_size=n, unique=True).map(lambda values: np.array(sorted(values)) / 8)


def some(strategy: st.SearchStrategy[Any], most: int = 2) -> st.SearchStrategy[Any]:
    return st.lists(strategy, max_size=most).map(tuple)


def table(values: st.SearchStrategy[Any], keys: st.SearchStrategy[str] = NAMES) -> st.SearchStrategy[Any]:
    return st.dictionaries(keys, values, max_size=3)


SPANS = st.tuples(FINITE, FINITE).map(lambda pair: (min(pair), max(pair)))
LIMITS = table(SPANS)
QUANTITIES = st.builds(Quantity, IDENTIFIERS, UNITS)
RECORDINGS = st.integers(0, 5).flatmap(lambda n: st.builds(Recording, NAMES, NAMES, table(any_reals(n)), COUNT, table(COUNT)))


@st.composite
def curves(draw: st.DrawFn, names: list[str]) -> Curve:
    n, recordings = draw(st.integers(0, 5)), draw(NOTES)
    flags = arrays(np.bool_, n)
    origin = whole(n, len(recordings)) if recordings or not n else st.none()
    columns = {name: draw(any_reals(n)) for name in names}
    return Curve(draw(NAMES), draw(st.none() | FINITE), columns, draw(flags), recordings, draw(st.none() | flags), draw(st.none() | origin))


@st.composite
def datasets(draw: st.DrawFn) -> Dataset:
    quantities = draw(st.dictionaries(NAMES, QUANTITIES, min_size=1, max_size=3))
    names = [*quantities]
    level = draw(st.none() | st.sampled_from(names))
    return Dataset(names[0], level, quantities, draw(some(RECORDINGS)), draw(some(curves(names))), draw(NOTES))


DATASETS = datasets()

CELLS = some(st.integers(1, 9))


@st.composite
def segmented_curves(draw: st.DrawFn) -> SegmentedCurve:
    variables = draw(NOTES)
    boundaries = tuple(draw(st.integers(2, 4).flatmap(ascending)) for _ in variables)
    cells = st.tuples(*(st.integers(1, len(locations) - 1) for locations in boundaries))
    segments = some(st.builds(Segment, NAMES, NAMES, cells, st.integers(0, 4).flatmap(whole)))
    return SegmentedCurve(draw(NAMES), draw(st.none() | FINITE), variables, boundaries, draw(LIMITS), draw(segments))


SEGMENTATIONS = some(segmented_curves())

STOPS = st.sampled_from(["tolerance", "max_terms", "no_gain", "rank", "bic", "free_run", "pruned"])
RULES = st.sampled_from(["unit_square", "max_abs", "none", "range"])


def scalings(names: tuple[str, ...]) -> st.SearchStrategy[Scaling]:
    n = len(names)
    return st.builds(Scaling, RULES, NAMES, st.just(names), reals(n), reals(n), FINITE, FINITE)


@st.composite
def segment_fits(draw: st.DrawFn) -> SegmentFit:
    m = draw(st.integers(1, 5))
    k = draw(st.integers(0, m))
    selection = Selection(
        chosen=np.array(draw(st.permutations(range(m)))[:k], dtype=np.int64),
        g=draw(reals(k)),
        err=draw(arrays(np.float64, k, elements=st.floats(0, 1) | st.just(np.nan))),
        theta=draw(reals(k)),
        theta_error=draw(any_reals(k)),
        a=draw(reals(k, k)),
        g_all=draw(any_reals(k, m)),
        err_all=draw(any_reals(k, m)),
        runner_up=draw(whole(k, m, -1)),
        tied=draw(whole(k)),
        condition=draw(REAL),
        sse=draw(FINITE),
        yy=draw(FINITE),
        samples=draw(COUNT),
        stop=draw(STOPS),
    )
    candidates = tuple(draw(st.lists(NAMES, min_size=m, max_size=m)))
    return SegmentFit(draw(NAMES), draw(NAMES), draw(CELLS), candidates, draw(NOTES.flatmap(scalings)), selection)


STATUSES = st.sampled_from(["converged", "at_bound", "rank_deficient", "stopped_by_limit"])


def formulas(parameters: st.SearchStrategy[Any], name: st.SearchStrategy[str]) -> st.SearchStrategy[FormulaFit]:
    return st.builds(FormulaFit, name, parameters, table(REAL), STATUSES, NAMES, COUNT, REAL, REAL, COUNT, NOTES)


FORMULAS = formulas(table(FINITE), NAMES)
BACKBONES = formulas(st.fixed_dictionaries(dict.fromkeys(literature.get("sarosi").parameters, FINITE)), st.just("sarosi"))
FITS = st.builds(FitResult, st.none() | FORMULAS | st.builds(PiecesFit, some(segment_fits())), st.none() | FORMULAS, NOTES)

INPUTS = ("pressure", "strain")
SIDE = st.sampled_from(["continue", "continue_linear", "saturate", "zero"]) | FINITE
TERMS = ["1", "strain", "strain^2", "pressure*strain", "exp(-strain/0.02)"]
FUSIONS = st.builds(
    Fusion,
    transition=st.sampled_from(["linear", "cubic"]),
    z_s=st.floats(0, 0.5),
    extrapolation=st.fixed_dictionaries({name: st.tuples(SIDE, SIDE) for name in INPUTS}),
    levels=st.sampled_from(["linear", "pchip"]),
    shrink=st.floats(0, 1),
)
ALL_LIMITS = st.fixed_dictionaries(dict.fromkeys(INPUTS, SPANS))


@st.composite
def functions(draw: st.DrawFn, cell: tuple[int, ...]) -> SegmentFunction:
    terms = tuple(draw(st.lists(st.sampled_from(TERMS), max_size=3)))
    k = len(terms)
    numbers = [draw(reals(k)), draw(any_reals(k)), draw(reals(k)), draw(any_reals(k))]
    scaling = draw(scalings(INPUTS))
    return SegmentFunction(draw(NAMES), cell, terms, *numbers, scaling, draw(COUNT), draw(REAL), draw(STOPS), draw(LIMITS))


@st.composite
def pieces(draw: st.DrawFn) -> Pieces:
    variables = draw(st.sampled_from([(), ("strain",)]))
    level = draw(st.none() | st.just("pressure"))
    levels = [None] if level is None else draw(st.integers(1, 2).flatmap(ascending)).tolist()
    kept = draw(st.booleans())

    def curve(value: float | None) -> CurveFunction:
        boundaries = tuple(draw(st.integers(2, 3).flatmap(ascending)) for _ in variables)
        cells = list(product(*(range(1, len(locations)) for locations in boundaries)))
        segments = tuple(draw(functions(cell)) for cell in cells) if kept else ()
        return CurveFunction(draw(NAMES), value, boundaries, draw(ALL_LIMITS), segments, draw(st.none() | FINITE))

    made = tuple(map(curve, levels))
    return Pieces(level, variables, made, draw(FUSIONS), draw(st.none() | BACKBONES), draw(FOLDS))


RANGES = st.builds(CurveRange, NAMES, st.none(), ALL_LIMITS).map(lambda curve: (curve,))
FOLDS = some(st.builds(FoldError, NAMES, REAL, COUNT))
STATES = st.builds(
    StateSet,
    st.just(("pressure", "force[k-1]", "slow(pressure, 0.5)")),
    POSITIVE,
    LIMITS,
    table(st.tuples(FINITE, FINITE)),
    st.just(np.zeros(0)) | st.just(np.zeros(3)),
    st.just(np.zeros(0)) | st.just(np.ones(3)),
    POSITIVE,
).filter(lambda states: len(states.low) == len(states.high))
MEMORY_TERMS = st.just(("pressure", "force[k-1]*slow(pressure, 0.5)"))
MEMORIES = st.builds(MemoryModel, st.just("force"), STATES, MEMORY_TERMS, reals(2), any_reals(2), FINITE, SPANS)


LEFT_OUT = st.builds(
    LeftOut,
    st.sampled_from(["levels", "recordings", "blocks"]),
    st.integers(2, 99),
    st.just(("pressure=100", "pressure=200")),
    whole(2),
    reals(2),
    st.just(np.array([0.0, 2.5])),
    st.just(np.array([[0.0, 0.5, 1.0], [1e-9, 2.0, 2.0]])),
)


def models(bodies: st.SearchStrategy[Any]) -> st.SearchStrategy[Model]:
    """Models with some bodies."""
    inputs = st.permutations([Quantity("pressure", "kPa"), Quantity("strain", "1")]).map(tuple)
    outputs = st.builds(Quantity, st.just("force"), UNITS)
    return st.builds(Model, name=NAMES, output=outputs, inputs=inputs, body=bodies, notes=NOTES, left_out=st.none() | LEFT_OUT)


ALONE = pieces() | st.builds(Formula, BACKBONES, st.none(), RANGES) | st.builds(Memory, MEMORIES, RANGES, st.none() | BACKBONES)
RENAMED = table(st.sampled_from(["pressure", "-strain", "2*pressure"]), st.sampled_from(INPUTS))
PARTS = st.builds(Part, models(ALONE), st.sampled_from([1.0, -1.0]), RENAMED)
SUMS = st.builds(Sum, st.lists(PARTS, min_size=1, max_size=2).map(tuple))
MODELS = models(ALONE | SUMS)

SCORES = st.builds(Score, NAMES, NAMES, st.sampled_from(["train", "validate"]), NAMES, COUNT, REAL, REAL, REAL, NAMES, REAL, REAL, REAL)
VALIDATIONS = st.builds(Validation, table(some(st.integers(0, 4).flatmap(any_reals))), table(FORMULAS), some(SCORES), table(UNITS))


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
