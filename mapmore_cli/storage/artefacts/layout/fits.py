"""Recordings and the curves made from them; segment functions as they were found, fits of formulas, models with memory and of motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.domain.arrays import in_blocks
from mapmore_cli.domain.fits import FormulaFit, Optimum, Scaling, SegmentFit, Selection
from mapmore_cli.domain.memory import Identified, MemoryFit, MemoryModel, StateSet
from mapmore_cli.domain.motion import BUMPLESS, CARRIED, HARD, REST, ZERO, Motion, MotionFit, MotionSection, SectionSearch
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.modelling.expressions import ExpressionError, state
from mapmore_cli.modelling.expressions.states import Measured, Operated
from mapmore_cli.modelling.literature.literature_model import SEVERITY
from mapmore_cli.modelling.memory.states import setting_of
from mapmore_cli.storage.artefacts.codecs import adapted, added, named, number, numbers, optional, pairs, shown, text
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.derived import (
    ANY_REAL,
    ANY_REALS,
    ANY_TABLE,
    ASCENDING,
    CELL,
    NAME,
    PAIR,
    REALS,
    SPAN,
    TABLE,
    TEXTS,
    expression_faults,
    stored,
)
from mapmore_cli.storage.artefacts.schema import Fault, Field

QUANTITY = stored(Quantity, {"name": NAME})

RECORDING = stored(Recording)


def _curve_faults(curve: Curve) -> Iterator[Fault]:
    last = -1 if curve.origin is None else max((int(block.max()) for block in in_blocks(curve.origin)), default=-1)
    if last >= len(curve.recordings):
        yield "origin", f"names recording {last} of {len(curve.recordings)}"


CURVE = stored(Curve, rule=_curve_faults)


def _dataset_faults(dataset: Dataset) -> Iterator[Fault]:
    for field, name in (("target", dataset.target), ("level", dataset.level)):
        if name is not None and name not in dataset.quantities:
            yield field, f"is {shown(name)}, which is none of the quantities"
    for place, curve in enumerate(dataset.curves):
        if dataset.target not in curve.columns:
            yield f"curves/{place:03d}/columns", f"has no {shown(dataset.target)}, which is the target"
        if strange := [name for name in curve.columns if name not in dataset.quantities]:
            yield f"curves/{place:03d}/columns", f"has {shown(strange[0])}, which is none of the quantities"


DATASET = stored(
    Dataset,
    {"notes": TEXTS},
    units=lambda dataset: {
        **{name: quantity.unit for name, quantity in dataset.quantities.items()},
        "level": f"[{dataset.level}]" if dataset.level else NO_UNIT,
    },
    rule=_dataset_faults,
)

STOP = text(words=("tolerance", "max_terms", "no_gain", "rank", "bic", "aicc", "press", "free_run", "pruned"))

RULE = text(words=("unit_square", "max_abs", "none", "range"))

SCALING = stored(
    Scaling,
    {"rule": RULE, "slope": REALS, "intercept": REALS},
    units=lambda scaling: {"slopes": ", ".join(f"1/[{name}]" for name in scaling.variables) or NO_UNIT},
)


def _selection_faults(selection: Selection) -> Iterator[Fault]:
    candidates = selection.err_all.shape[1]
    for field in ("chosen", "runner_up"):
        indices = getattr(selection, field)
        if indices.size and indices.max() >= candidates:
            yield field, f"names candidate {indices.max()} of {candidates}"
    if len(set(selection.chosen.tolist())) < len(selection.chosen):
        yield "chosen", "names a candidate twice"


SELECTION = stored(
    Selection,
    {
        "g": REALS,
        "theta": REALS,
        "a": TABLE,
        "g_all": ANY_TABLE,
        "err_all": ANY_TABLE,
        "runner_up": numbers("<i8", least=-1),
        "condition": ANY_REAL,
        "stop": STOP,
    },
    derived=(Field("err_sum", REALS, "(k) running sum of err", derived=lambda selection: np.cumsum(selection.err)),),
    rule=_selection_faults,
)

SEGMENT_FIT = stored(
    SegmentFit,
    {"cell": CELL},
    derived=(Field("terms", TEXTS, "(k) names of the chosen terms, in the order of selection", NO_UNIT, derived=lambda fit: fit.terms),),
)

OPTIMUM = stored(Optimum, {"held_out_rmse": ANY_REAL})


def _formula_faults(fit: FormulaFit) -> Iterator[Fault]:
    lost = [name for name, value in fit.parameters.items() if not np.isfinite(value)]
    if lost and not fit.failed:
        yield "parameters", f"has no value of {shown(lost[0])}, although the fit has not failed"


FORMULA_FIT = stored(
    FormulaFit,
    {
        "parameters": pairs(ANY_REALS),
        "errors": pairs(ANY_REALS),
        "status": text(words=SEVERITY),
        "condition": ANY_REAL,
        "sse": ANY_REAL,
        "notes": TEXTS,
    },
    rule=_formula_faults,
)


def _state_faults(states: StateSet) -> Iterator[Fault]:
    for name in states.names:
        try:
            found = state(name)
        except ExpressionError as error:
            yield "names", f"has {shown(name)}, which is no state: {error}"
            continue
        while not isinstance(found, Measured):
            try:
                _ = setting_of(found, states) if isinstance(found, Operated) else None
            except KeyError:
                yield "ranges", f"and `resonances` say nothing of {shown(found.source.name)}, which {shown(name)} is made of"
            found = found.source
    if len({*states.names}) < len(states.names):
        yield "names", "name a state twice"
    if states.step <= 0:
        yield "step", f"is {states.step:g} s"
    if len(states.low) != len(states.high):
        yield "low", f"has {len(states.low)} values, where `high` has {len(states.high)}"
    elif (states.low > states.high).any():
        yield "low", "is above `high`"


STATE_SET = stored(StateSet, {"resonances": named(PAIR), "low": REALS, "high": REALS, "margin": number(float, least=0)}, rule=_state_faults)


def _memory_faults(model: MemoryModel) -> Iterator[Fault]:
    return expression_faults("terms", model.terms, model.states.names)


MEMORY_MODEL = stored(
    MemoryModel,
    {"output": NAME, "theta": REALS, "limits": SPAN, "start": added(text(words=("measured", "steady", "identified")), "measured")},
    rule=_memory_faults,
)


def _memory_fit_faults(fit: MemoryFit) -> Iterator[Fault]:
    for field in ("forward", "substitutes"):
        indices = getattr(fit, field)
        if indices.size and indices.max() >= len(fit.candidates):
            yield field, f"names candidate {indices.max()} of {len(fit.candidates)}"


IDENTIFIED = stored(Identified, {"numbers": REALS})


MEMORY_FIT = stored(
    MemoryFit,
    {"ridge": number(float, least=0), "substitutes": numbers("<i8", least=-1), "held_out": optional(ANY_REALS)},
    rule=_memory_fit_faults,
)


BOUNDARIES = adapted(ASCENDING, store=list, load=lambda array: tuple(array.tolist()))

MOTION_SECTION = stored(MotionSection, {"weights": REALS})


def _motion_faults(motion: Motion) -> Iterator[Fault]:
    wanted = (len(motion.boundaries) + 1) * (2 if motion.directed else 1)
    if len(motion.sections) != wanted:
        yield "sections", f"has {len(motion.sections)} sections, where the boundaries make {wanted}"
    if not motion.step > 0:
        yield "step", "is not positive"
    if motion.drives[:1] != (motion.input,):
        yield "drives", f"does not begin with the input {shown(motion.input)}"
    for place, section in enumerate(motion.sections):
        if len(section.weights) != len(motion.drives):
            yield f"sections/{place}/weights", f"has {len(section.weights)} values for {len(motion.drives)} drives"


def _motion_fit_faults(fit: MotionFit) -> Iterator[Fault]:
    if len(fit.searches) != len(fit.model.sections):
        yield "searches", f"has {len(fit.searches)} searches for {len(fit.model.sections)} sections"


MOTION = stored(
    Motion,
    {
        "switching": text(words=(HARD, CARRIED, BUMPLESS)),
        "boundaries": BOUNDARIES,
        "limits": SPAN,
        "start": added(text(words=(REST, ZERO)), REST),
    },
    rule=_motion_faults,
)

SECTION_SEARCH = stored(SectionSearch, {"history": REALS})

MOTION_FIT = stored(MotionFit, {"notes": TEXTS}, rule=_motion_fit_faults)
