"""The model that predicts without any other file."""

from __future__ import annotations

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
    Side,
    Signal,
    Sum,
)
from mapmore_cli.storage.artefacts.codecs import adapted, named, numbered, optional, pairs
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import CELL, COUNT, LIMITS, OPTIONAL_REAL, OPTIONAL_TEXT, REAL, REALS, TEXT, TEXTS
from mapmore_cli.storage.artefacts.layout.data import QUANTITY
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT, SCALING
from mapmore_cli.storage.artefacts.layout.memory import MEMORY_MODEL
from mapmore_cli.storage.artefacts.schema import Field, Schema, nested, record, rows, variant


def _side_text(side: Side) -> str:
    return side if isinstance(side, str) else repr(float(side))


def _side(stored: str) -> Side:
    try:
        return float(stored)
    except ValueError:
        return stored


SIDES = named(adapted(TEXTS, store=lambda sides: [_side_text(side) for side in sides], load=lambda stored: tuple(map(_side, stored))))


FOLD_ERROR = Schema(
    FoldError,
    "Cross-validation error of one choice.",
    (
        Field("choice", TEXT, "what was cross-validated", NO_UNIT),
        Field("rmse", REAL, "pooled error of all left-out samples", "[target]"),
        Field("folds", COUNT, "number of folds"),
    ),
)

SEGMENT_FUNCTION = Schema(
    SegmentFunction,
    "`f(x) = y_slope sum_k theta_k D_k(slope x + intercept) + y_intercept` (M2 eq 8).",
    (
        Field("id", TEXT, "identifier of the segment", NO_UNIT),
        Field("cell", CELL, "place along each segmented variable, from 1", NO_UNIT),
        Field("terms", TEXTS, "(k) names of the terms D_k, in the order of selection", NO_UNIT),
        Field("theta", REALS, "(k) coefficients of the terms, in scaled coordinates"),
        Field("theta_error", REALS, "(k) standard errors of theta; NaN without a degree of freedom"),
        Field("g", REALS, "(k) coefficients of the orthogonalised regressors"),
        Field("err", REALS, "(k) error reduction ratios"),
        Field("scaling", record(SCALING), "scaling of the segment", NO_UNIT),
        Field("samples", COUNT, "samples fitted to"),
        Field("condition", REAL, "2-norm condition number of the chosen regressors"),
        Field("stop", TEXT, "why selection stopped", NO_UNIT),
        Field("limits", LIMITS, "least and greatest training value of each segmented variable in the segment", "[*]"),
    ),
)

CURVE_FUNCTION = Schema(
    CurveFunction,
    "The fused segment functions of one training curve.",
    (
        Field("curve", TEXT, "identifier of the curve", NO_UNIT),
        Field("level", OPTIONAL_REAL, "value of the level quantity", "[level]"),
        Field("boundaries", numbered(REALS), "segment locations of each segmented variable, both ends included", "[variables.*]"),
        Field("limits", LIMITS, "least and greatest training value of each input", "[*]"),
        Field("segments", numbered(record(SEGMENT_FUNCTION)), "segment functions", NO_UNIT),
        Field("threshold", OPTIONAL_REAL, "threshold along the aligned variable, where there is one", "[aligned]"),
    ),
)

FUSION = Schema(
    Fusion,
    "How the pieces are joined (M2 eq 9-12).",
    (
        Field("transition", TEXT, "`linear`, `quadratic` or `cubic`", NO_UNIT),
        Field("z_s", REAL, "half-width of a transition zone, as a fraction of the segment"),
        Field("extrapolation", SIDES, "behaviour below and above the limits of each input: a word, or the value it takes", NO_UNIT),
        Field("levels", TEXT, "interpolation between curves, `linear` or `pchip`", NO_UNIT),
        Field("aligned", OPTIONAL_TEXT, "variable along which curves are aligned at their thresholds", NO_UNIT),
        Field("shrink", REAL, "share of the pieces on a backbone that is carried to the middle between two levels"),
    ),
)

SIGNAL = Schema(
    Signal,
    "An input that follows from another one over time.",
    (
        Field("name", TEXT, "name of the input", NO_UNIT),
        Field("kind", TEXT, "`rate` or `direction`", NO_UNIT),
        Field("of", TEXT, "the quantity that it follows from", NO_UNIT),
        Field("window", REAL, "width of the window of a rate; 0 for a direction", "s"),
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

PIECES = Schema(
    Pieces,
    "MAPMORE: `output = backbone + sum_i f_i prod_j w_ij` (M2 eq 9).",
    (
        Field("level", OPTIONAL_TEXT, "the input that is constant within a curve", NO_UNIT),
        Field("variables", TEXTS, "segmented variables", NO_UNIT),
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
)

FORMULA = Schema(
    Formula,
    "A formula of the literature as the whole model.",
    (
        Field("fit", record(FORMULA_FIT), "the fitted formula", NO_UNIT),
        Field("level", OPTIONAL_TEXT, "the input that is constant within a training curve", NO_UNIT),
        Field("ranges", numbered(record(CURVE_RANGE)), "training range of each curve", NO_UNIT),
    ),
    units=lambda formula: {"level": f"[{formula.level}]" if formula.level else NO_UNIT},
)

MEMORY = Schema(
    Memory,
    "A model with memory, on a backbone or by itself.",
    (
        Field("model", record(MEMORY_MODEL), "states, terms and coefficients", NO_UNIT),
        Field("ranges", numbered(record(CURVE_RANGE)), "training range of each curve", NO_UNIT),
        Field("backbone", optional(record(FORMULA_FIT)), "formula that it is added to", NO_UNIT),
    ),
)


def _model() -> Schema:
    return MODEL


PART = Schema(
    Part,
    "A model in a sum.",
    (
        Field("model", nested(Model, _model), "the model", NO_UNIT),
        Field("sign", REAL, "+1 or -1: how its output counts"),
        Field("inputs", pairs(TEXTS), "its inputs that have another name in the sum, as expressions of the sum's inputs", NO_UNIT),
    ),
)

SUM = Schema(
    Sum, "Models that are added up.", (Field("parts", numbered(record(PART)), "the summands, with their signs and inputs", NO_UNIT),)
)

BODIES = {"pieces": PIECES, "formula": FORMULA, "memory": MEMORY, "sum": SUM}
"""What a model consists of, by the name of its kind. Whoever adds a kind adds its body here."""

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
    ),
    units=lambda model: {
        **{quantity.name: quantity.unit for quantity in (*model.inputs, model.output)},
        "target": model.output.unit,
    },
)
