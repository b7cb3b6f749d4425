"""The model that predicts without any other file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from math import isfinite

import numpy as np

from mapmore_cli.domain.fits import FormulaFit
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
    Side,
    StateSpace,
    Sum,
)
from mapmore_cli.domain.recording import Signal
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import state
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.artefacts.codecs import Codec, adapted, added, named, number, numbered, pairs, shown, text
from mapmore_cli.storage.artefacts.integrity import Invalid
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.derived import (
    ANY_REAL,
    ASCENDING,
    CELL,
    CUTS,
    INDICES,
    LIMITS,
    NAME,
    OPTIONAL_TEXT,
    REALS,
    SHARE,
    TABLE,
    TEXTS,
    completed,
    expression_faults,
    schema_of,
    stored,
)
from mapmore_cli.storage.artefacts.layout.fits import STOP
from mapmore_cli.storage.artefacts.schema import Fault, Field, Schema, rows, variant


def _side_text(side: Side) -> str:
    return side if isinstance(side, str) else repr(float(side))


def _side(stored: str) -> Side:
    try:
        return float(stored)
    except ValueError:
        return stored


def _are_sides(sides: tuple[Side, ...], where: str) -> None:
    if len(sides) != 2:
        raise Invalid(where, f"has {len(sides)} sides, where two belong")
    for side in sides:
        if side not in BEYOND if isinstance(side, str) else not isfinite(side):
            raise Invalid(where, f"is {shown(str(side))}, which is none of {', '.join(BEYOND)}, and no number")


BEYOND = ("continue", "continue_linear", "saturate", "zero")
SIDES = named(
    adapted(
        TEXTS, store=lambda sides: [_side_text(side) for side in sides], load=lambda stored: tuple(map(_side, stored)), check=_are_sides
    )
)


FOLD_ERROR = stored(FoldError, {"rmse": ANY_REAL})


def _segment_faults(segment: SegmentFunction) -> Iterator[Fault]:
    return expression_faults("terms", segment.terms, segment.scaling.variables)


SEGMENT_FUNCTION = stored(
    SegmentFunction, {"cell": CELL, "theta": REALS, "g": REALS, "condition": ANY_REAL, "stop": STOP, "limits": LIMITS}, rule=_segment_faults
)


def _curve_faults(curve: CurveFunction) -> Iterator[Fault]:
    counts = [len(locations) - 1 for locations in curve.boundaries]
    if any(count < 1 for count in counts):
        yield "boundaries", "has fewer than two locations along a variable"
    cells = [segment.cell for segment in curve.segments]
    if cells and sorted(cells) != sorted(product(*(range(1, count + 1) for count in counts))):
        yield "segments", f"are not one for each of {' x '.join(map(str, counts)) or '1'} cells"


CURVE_FUNCTION = stored(CurveFunction, {"boundaries": numbered(CUTS)}, rule=_curve_faults)

FUSION = completed(
    Schema(
        Fusion,
        "How the pieces are joined (M2 eq 9-12).",
        (
            Field("transition", text(words=("linear", "quadratic", "cubic")), "`linear`, `quadratic` or `cubic`", NO_UNIT),
            Field("z_s", number(float, least=0, most=0.5), "half-width of a transition zone, as a fraction of the segment"),
            Field("extrapolation", SIDES, "behaviour below and above the limits of each input: a word, or the value it takes", NO_UNIT),
            Field("levels", text(words=("linear", "pchip")), "interpolation between curves, `linear` or `pchip`", NO_UNIT),
            Field("aligned", OPTIONAL_TEXT, "variable along which curves are aligned at their thresholds", NO_UNIT),
            Field("shrink", SHARE, "share of the pieces on a backbone that is carried to the middle between two levels"),
            Field(
                "hold",
                added(text(words=("samples", "none")), "samples"),
                "`samples` where segment functions are held beyond theirs, or `none`",
                NO_UNIT,
            ),
            Field("domain", added(LIMITS, {}), "limits of the whole training domain, for inputs that extrapolation acts on there", "[*]"),
        ),
    )
)

SIGNAL = stored(Signal, {"name": NAME, "kind": text(words=("rate", "direction")), "window": number(float, least=0)})


CURVE_RANGE = stored(CurveRange)


def _level_faults(level: str | None, ranges: Sequence[CurveRange], field: str) -> Iterator[Fault]:
    values = [curve.level for curve in ranges]
    if not values:
        yield field, "holds no curve"
    elif level is None:
        if values != [None]:
            yield field, f"holds {len(values)} curves, where there are no levels"
    elif any(value is None for value in values):
        yield field, "holds a curve without a level"
    elif any(second <= first for first, second in pairwise(value for value in values if value is not None)):
        yield field, "does not ascend from level to level"


def _pieces_faults(pieces: Pieces) -> Iterator[Fault]:
    yield from _level_faults(pieces.level, pieces.ranges, "curves")
    if len({bool(curve.segments) for curve in pieces.curves}) > 1:
        yield "curves", "holds a curve without segments, where others have some"
    if pieces.level in pieces.variables or len({*pieces.variables}) < len(pieces.variables):
        yield "variables", "hold the level, or one of them twice"
    if pieces.fusion.aligned is not None and any(curve.threshold is None for curve in pieces.curves):
        yield "curves", "holds a curve without a threshold, although curves are aligned"


PIECES = stored(
    Pieces,
    {"cross_validation": rows(FOLD_ERROR)},
    units=lambda pieces: {
        **{f"variables.{place}": f"[{name}]" for place, name in enumerate(pieces.variables)},
        "level": f"[{pieces.level}]" if pieces.level else NO_UNIT,
        "aligned": f"[{pieces.fusion.aligned}]" if pieces.fusion.aligned else NO_UNIT,
    },
    rule=_pieces_faults,
)

FORMULA = stored(
    Formula,
    units=lambda formula: {"level": f"[{formula.level}]" if formula.level else NO_UNIT},
    rule=lambda formula: _level_faults(formula.level, formula.ranges, "ranges"),
)

MEMORY = stored(Memory)

STATE_SPACE = stored(StateSpace)


def _left_out_faults(left_out: LeftOut) -> Iterator[Fault]:
    if not left_out.parts:
        yield "parts", "is empty"
    if left_out.sizes.size and (left_out.sizes.min() < 0 or (np.diff(left_out.sizes, axis=1) < 0).any()):
        yield "sizes", "holds quantiles that are negative, or fall"
    if (left_out.scatter < 0).any():
        yield "scatter", "is negative"


def _tuple(codec: Codec) -> Codec:
    return adapted(codec, store=list, load=lambda array: tuple(array.tolist()))


LEFT_OUT = stored(
    LeftOut,
    {
        "curves": number(int, least=2),
        "offset": REALS,
        "scatter": REALS,
        "sizes": TABLE,
        "places": added(_tuple(ASCENDING), ()),
        "repeats": added(_tuple(INDICES), ()),
    },
    rule=_left_out_faults,
)


PART = stored(Part, {"sign": number(float, least=-1, most=1), "inputs": pairs(TEXTS)})

SUM = stored(Sum, rule=lambda body: () if body.parts else [("parts", "holds no model")])

BODIES = {kind.name: schema_of(kind.body) for kind in kinds()}
"""What a model consists of, by the name of its kind."""


def _model_faults(model: Model) -> Iterator[Fault]:
    known = [quantity.name for quantity in model.inputs]
    if len(set(known)) < len(known):
        yield "inputs", "name a quantity twice"
    backbone = model.backbone
    if backbone is not None:
        yield from _formula_faults(backbone, known)
    yield from _signal_faults(model.signals, known)
    if len({frozenset(curve.limits) for curve in getattr(model.body, "ranges", ())}) > 1:
        yield "body/ranges", "do not name the same inputs"
    match model.body:
        case Pieces() as pieces:
            yield from _input_faults(pieces, known)
        case Memory(memory):
            yield from _output_faults(memory.output, model)
            if strange := {state(name).quantity for name in memory.states.names} - {*known, memory.output}:
                yield "body/model/states/names", f"go on from {shown(min(strange))}, which is none of the inputs"
        case StateSpace(motion):
            yield from _output_faults(motion.output, model)
            yield from expression_faults("body/motion/drives", (motion.input, *motion.drives), known)
        case Sum(parts):
            for place, part in enumerate(parts):
                yield from _part_faults(f"body/parts/{place:03d}/inputs", part, known)


def _signal_faults(signals: Sequence[Signal], known: Sequence[str]) -> Iterator[Fault]:
    wanted = {*known}
    for signal in reversed(signals):
        if signal.name == "time" or signal.name not in wanted:
            yield "signals", f"make {shown(signal.name)}, which is none of the inputs"
        wanted.add(signal.of)


def _output_faults(output: str, model: Model) -> Iterator[Fault]:
    if output != model.output.name:
        yield "output", f"is {shown(model.output.name)}, where the body predicts {shown(output)}"


def _part_faults(field: str, part: Part, known: Sequence[str]) -> Iterator[Fault]:
    own = [one.name for one in part.model.inputs]
    yield from expression_faults(field, part.inputs.values(), known)
    if strange := [name for name in own if name not in (*part.inputs, *known)]:
        yield field, f"does not say what {shown(strange[0])} is, which is none of the inputs of the sum"
    if strange := [name for name in part.inputs if name not in own]:
        yield field, f"says what {shown(strange[0])} is, which is none of the inputs of the part"


def _formula_faults(fit: FormulaFit, known: Sequence[str]) -> Iterator[Fault]:
    if not fit.definition and fit.name not in literature.names():
        yield "body", f"has the formula {shown(fit.name)}, which is unknown"
        return
    try:
        formula = literature.of(fit)
    except (ValueError, literature.UnknownFormula) as error:
        yield "body", f"has a definition of {shown(fit.name)} that is none: {error}"
        return
    for what, needed, given in (("parameter", formula.parameters, fit.parameters), ("input", formula.inputs, known)):
        if missing := [name for name in needed if name not in given]:
            yield "body", f"lacks the {what} {shown(missing[0])} of the formula {fit.name}"


def _input_faults(pieces: Pieces, known: Sequence[str]) -> Iterator[Fault]:
    """Names in the pieces that are none of the model's inputs, and inputs of which the pieces do not say enough."""
    used = {
        "body/level": [pieces.level] if pieces.level is not None else [],
        "body/variables": pieces.variables,
        "body/fusion/aligned": [pieces.fusion.aligned] if pieces.fusion.aligned is not None else [],
        "body/curves": [name for segment in pieces.segments for name in segment.scaling.variables],
    }
    for field, names in used.items():
        if strange := [name for name in names if name not in known]:
            yield field, f"has {shown(strange[0])}, which is none of the inputs"
    free = [name for name in known if name != pieces.level]
    wanted = [("body/fusion/extrapolation", known, pieces.fusion.extrapolation), *(("body/curves", free, c.limits) for c in pieces.curves)]
    for field, names, given in wanted:
        if missing := [name for name in names if name not in given]:
            yield field, f"says nothing of {shown(missing[0])}"


MODEL: Schema = stored(
    Model,
    {"body": variant(BODIES), "signals": rows(SIGNAL), "notes": TEXTS},
    units=lambda model: {**{quantity.name: quantity.unit for quantity in (*model.inputs, model.output)}, "target": model.output.unit},
    rule=_model_faults,
)
