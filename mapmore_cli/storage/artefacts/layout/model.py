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
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.artefacts.codecs import Codec, adapted, added, named, number, numbered, optional, pairs, shown, text
from mapmore_cli.storage.artefacts.integrity import Invalid
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import (
    ANY_REAL,
    ANY_REALS,
    ASCENDING,
    CELL,
    COUNT,
    CUTS,
    INDICES,
    LIMITS,
    NAME,
    OPTIONAL_REAL,
    OPTIONAL_TEXT,
    REAL,
    REALS,
    SHARE,
    TABLE,
    TEXT,
    TEXTS,
    expression_faults,
)
from mapmore_cli.storage.artefacts.layout.data import QUANTITY
from mapmore_cli.storage.artefacts.layout.derived import completed, schema_of
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT, SCALING, STOP
from mapmore_cli.storage.artefacts.layout.memory import MEMORY_MODEL
from mapmore_cli.storage.artefacts.layout.motion import MOTION
from mapmore_cli.storage.artefacts.schema import Fault, Field, Schema, nested, record, rows, variant


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
        TEXTS,
        store=lambda sides: [_side_text(side) for side in sides],
        load=lambda stored: tuple(map(_side, stored)),
        check=_are_sides,
    )
)


FOLD_ERROR = Schema(
    FoldError,
    "Cross-validation error of one choice.",
    (
        Field("choice", TEXT, "what was cross-validated", NO_UNIT),
        Field("rmse", ANY_REAL, "pooled error of all left-out samples", "[target]"),
        Field("folds", COUNT, "number of folds"),
    ),
)


def _segment_faults(segment: SegmentFunction) -> Iterator[Fault]:
    return expression_faults("terms", segment.terms, segment.scaling.variables)


SEGMENT_FUNCTION = Schema(
    SegmentFunction,
    "`f(x) = y_slope sum_k theta_k D_k(slope x + intercept) + y_intercept` (M2 eq 8).",
    (
        Field("id", TEXT, "identifier of the segment", NO_UNIT),
        Field("cell", CELL, "place along each segmented variable, from 1", NO_UNIT),
        Field("terms", TEXTS, "(k) names of the terms D_k, in the order of selection", NO_UNIT),
        Field("theta", REALS, "(k) coefficients of the terms, in scaled coordinates"),
        Field("theta_error", ANY_REALS, "(k) standard errors of theta; NaN without a degree of freedom"),
        Field("g", REALS, "(k) coefficients of the orthogonalised regressors"),
        Field("err", ANY_REALS, "(k) error reduction ratios"),
        Field("scaling", record(SCALING), "scaling of the segment", NO_UNIT),
        Field("samples", COUNT, "samples fitted to"),
        Field("condition", ANY_REAL, "2-norm condition number of the chosen regressors"),
        Field("stop", STOP, "why selection stopped", NO_UNIT),
        Field("limits", LIMITS, "least and greatest training value of each segmented variable in the segment", "[*]"),
    ),
    rule=_segment_faults,
)


def _curve_faults(curve: CurveFunction) -> Iterator[Fault]:
    counts = [len(locations) - 1 for locations in curve.boundaries]
    if any(count < 1 for count in counts):
        yield "boundaries", "has fewer than two locations along a variable"
    cells = [segment.cell for segment in curve.segments]
    if cells and sorted(cells) != sorted(product(*(range(1, count + 1) for count in counts))):
        yield "segments", f"are not one for each of {' x '.join(map(str, counts)) or '1'} cells"


CURVE_FUNCTION = Schema(
    CurveFunction,
    "The fused segment functions of one training curve.",
    (
        Field("curve", TEXT, "identifier of the curve", NO_UNIT),
        Field("level", OPTIONAL_REAL, "value of the level quantity", "[level]"),
        Field("boundaries", numbered(CUTS), "(p) segment locations of each segmented variable, both ends included", "[variables.*]"),
        Field("limits", LIMITS, "least and greatest training value of each input", "[*]"),
        Field("segments", numbered(record(SEGMENT_FUNCTION)), "segment functions", NO_UNIT),
        Field("threshold", OPTIONAL_REAL, "threshold along the aligned variable, where there is one", "[aligned]"),
    ),
    rule=_curve_faults,
)

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

SIGNAL = Schema(
    Signal,
    "An input that follows from another one over time.",
    (
        Field("name", NAME, "name of the input", NO_UNIT),
        Field("kind", text(words=("rate", "direction")), "`rate` or `direction`", NO_UNIT),
        Field("of", TEXT, "the quantity that it follows from", NO_UNIT),
        Field("window", number(float, least=0), "width of the window of a rate; 0 for a direction", "s"),
        Field("order", COUNT, "order of the polynomials of a rate; 0 for a direction"),
        Field("factor", REAL, "unit of the quantity per second, in the unit of the rate"),
        Field("seconds", REAL, "seconds in one unit of the time", "s"),
        Field("dead_band", REAL, "rate up to which the last direction holds; 0 for a rate", "that of the rate"),
    ),
)


CURVE_RANGE = Schema(
    CurveRange,
    "Training range of every input within one training curve.",
    (
        Field("curve", TEXT, "identifier of the curve", NO_UNIT),
        Field("level", OPTIONAL_REAL, "value of the level quantity", "[level]"),
        Field("limits", LIMITS, "least and greatest training value of each input", "[*]"),
    ),
)


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
    if pieces.fusion.aligned is not None and any(curve.threshold is None for curve in pieces.curves):
        yield "curves", "holds a curve without a threshold, although curves are aligned"


PIECES = completed(
    Schema(
        Pieces,
        "MAPMORE: `output = backbone + sum_i f_i prod_j w_ij` (M2 eq 9).",
        (
            Field("level", OPTIONAL_TEXT, "the input that is constant within a curve", NO_UNIT),
            Field("variables", TEXTS, "(p) segmented variables", NO_UNIT),
            Field("curves", numbered(record(CURVE_FUNCTION)), "training curves", NO_UNIT),
            Field("fusion", record(FUSION), "how the pieces are joined", NO_UNIT),
            Field("backbone", optional(record(FORMULA_FIT)), "formula that the pieces are added to", NO_UNIT),
            Field("cross_validation", rows(FOLD_ERROR), "errors that decided for or against the pieces on the backbone", NO_UNIT),
        ),
        units=lambda pieces: {
            **{f"variables.{place}": f"[{name}]" for place, name in enumerate(pieces.variables)},
            "level": f"[{pieces.level}]" if pieces.level else NO_UNIT,
            "aligned": f"[{pieces.fusion.aligned}]" if pieces.fusion.aligned else NO_UNIT,
        },
        rule=_pieces_faults,
    )
)

FORMULA = completed(
    Schema(
        Formula,
        "A formula of the literature as the whole model.",
        (
            Field("fit", record(FORMULA_FIT), "the fitted formula", NO_UNIT),
            Field("level", OPTIONAL_TEXT, "the input that is constant within a training curve", NO_UNIT),
            Field("ranges", numbered(record(CURVE_RANGE)), "training range of each curve", NO_UNIT),
        ),
        units=lambda formula: {"level": f"[{formula.level}]" if formula.level else NO_UNIT},
        rule=lambda formula: _level_faults(formula.level, formula.ranges, "ranges"),
    )
)

MEMORY = completed(
    Schema(
        Memory,
        "A model with memory, on a backbone or by itself.",
        (
            Field("model", record(MEMORY_MODEL), "states, terms and coefficients", NO_UNIT),
            Field("ranges", numbered(record(CURVE_RANGE)), "training range of each curve", NO_UNIT),
            Field("backbone", optional(record(FORMULA_FIT)), "formula that it is added to", NO_UNIT),
        ),
    )
)

STATE_SPACE = completed(
    Schema(
        StateSpace,
        "A model of motion: linear sections along an input (P).",
        (
            Field("motion", record(MOTION), "the sections", NO_UNIT),
            Field("ranges", numbered(record(CURVE_RANGE)), "training range of each curve", NO_UNIT),
        ),
    )
)


def _left_out_faults(left_out: LeftOut) -> Iterator[Fault]:
    if not left_out.parts:
        yield "parts", "is empty"
    if left_out.sizes.size and (left_out.sizes.min() < 0 or (np.diff(left_out.sizes, axis=1) < 0).any()):
        yield "sizes", "holds quantiles that are negative, or fall"
    if (left_out.scatter < 0).any():
        yield "scatter", "is negative"


def _tuple(codec: Codec) -> Codec:
    return adapted(codec, store=list, load=lambda array: tuple(array.tolist()))


LEFT_OUT = Schema(
    LeftOut,
    "How models of the rest missed each part of the training data that was left out of them: what intervals are made of.",
    (
        Field(
            "kind",
            text(words=("levels", "recordings", "blocks", "specimens")),
            "`levels`, `recordings`, `blocks` or `specimens`: what was left out in turn",
            NO_UNIT,
        ),
        Field("curves", number(int, least=2), "levels, recordings or blocks that train"),
        Field("parts", TEXTS, "(parts) names of the parts", NO_UNIT),
        Field("samples", INDICES, "(parts) samples of each"),
        Field("offset", REALS, "(parts) mean of measured minus predicted over each", "[target]"),
        Field("scatter", REALS, "(parts) standard deviation about the offset", "[target]"),
        Field("sizes", TABLE, "(parts, shares) quantiles of the absolute residuals of each at even shares from 0 to 1", "[target]"),
        Field("places", added(_tuple(ASCENDING), ()), "(levels) levels that train", "that of the level"),
        Field("repeats", added(_tuple(INDICES), ()), "(levels) recordings at each"),
        Field("largest", added(REAL, 0.0), "largest absolute training target", "[target]"),
        Field("residual", added(REAL, 0.0), "root mean square training residual", "[target]"),
        Field("astray", added(REAL, 0.0), "how far left-out predictions lie beyond the training target, as a share of its range"),
    ),
    rule=_left_out_faults,
)


def _model() -> Schema:
    return MODEL


PART = Schema(
    Part,
    "A model in a sum.",
    (
        Field("model", nested(Model, _model), "the model", NO_UNIT),
        Field("sign", number(float, least=-1, most=1), "+1 or -1: how its output counts"),
        Field("inputs", pairs(TEXTS), "its inputs that have another name in the sum, as expressions of the sum's inputs", NO_UNIT),
    ),
)

SUM = completed(
    Schema(
        Sum,
        "Models that are added up.",
        (Field("parts", numbered(record(PART)), "the summands, with their signs and inputs", NO_UNIT),),
        rule=lambda body: () if body.parts else [("parts", "holds no model")],
    )
)

BODIES = {kind.name: schema_of(kind.body) for kind in kinds()}
"""What a model consists of, by the name of its kind."""


def _model_faults(model: Model) -> Iterator[Fault]:
    known = [quantity.name for quantity in model.inputs]
    if len(set(known)) < len(known):
        yield "inputs", "name a quantity twice"
    backbone = model.backbone
    if backbone is not None:
        yield from _formula_faults(backbone, known)
    if isinstance(model.body, Pieces):
        yield from _input_faults(model.body, known)
    if isinstance(model.body, Sum):
        for place, part in enumerate(model.body.parts):
            yield from expression_faults(f"body/parts/{place:03d}/inputs", part.inputs.values(), known)
            if strange := [one.name for one in part.model.inputs if one.name not in (*part.inputs, *known)]:
                yield f"body/parts/{place:03d}/inputs", f"does not say what {shown(strange[0])} is, which is none of the inputs of the sum"


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


MODEL: Schema = Schema(
    Model,
    "A model that predicts without any other file: what all kinds have in common, and the body of one kind.",
    (
        Field("name", TEXT, "name of the run", NO_UNIT),
        Field("output", record(QUANTITY), "predicted quantity", NO_UNIT),
        Field("inputs", numbered(record(QUANTITY)), "quantities that the model needs", NO_UNIT),
        Field("body", variant(BODIES), "what the model consists of", NO_UNIT),
        Field("signals", rows(SIGNAL), "inputs that follow from others over time, each after those", NO_UNIT),
        Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
        Field("left_out", optional(record(LEFT_OUT)), "what intervals are made of, where the spec asked for them", NO_UNIT),
    ),
    units=lambda model: {
        **{quantity.name: quantity.unit for quantity in (*model.inputs, model.output)},
        "target": model.output.unit,
    },
    rule=_model_faults,
)
