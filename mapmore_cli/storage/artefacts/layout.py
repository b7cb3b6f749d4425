"""The stored types: every field of every HDF5 file of a run, declared once.

Units in brackets name the quantity whose unit applies: `[target]` is the modelled quantity, `[variables.0]` the first segmented variable,
`[*]` the quantity that a part is named after, `[slopes]` one over the unit of each scaled variable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.fits import FormulaFit, Scaling, Segment, SegmentedCurve, SegmentFit, Selection
from mapmore_cli.domain.memory import MemoryFit, MemoryModel, StateSet
from mapmore_cli.domain.models import CurveFunction, FoldError, Fusion, Model, SegmentFunction, Side, Signal
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.domain.results import FitResult
from mapmore_cli.domain.scores import Score, Validation
from mapmore_cli.storage.artefacts.codecs import adapted, added, named, number, numbered, numbers, optional, pairs, text, texts
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.schema import Field, Schema, nested, record, rows

TEXT, REAL, COUNT = text(), number(float), number(int)
OPTIONAL_TEXT, OPTIONAL_REAL = optional(TEXT), optional(REAL)
TEXTS = texts()
REALS, TABLE = numbers("<f8"), numbers("<f8", ndim=2)
INTEGERS = numbers("<i8")
FLAGS = numbers("|u1", load_dtype="bool")  # not HDF5's enumeration, which MATLAB reads as text
CELL = adapted(INTEGERS, store=list, load=lambda array: tuple(array.tolist()))
SPAN = adapted(REALS, store=list, load=lambda array: tuple(array.tolist()))
LIMITS = named(SPAN)


@dataclass(frozen=True)
class SegmentationFile:
    """What segment.h5 holds."""

    curves: tuple[SegmentedCurve, ...]


def _side_text(side: Side) -> str:
    return side if isinstance(side, str) else repr(float(side))


def _side(stored: str) -> Side:
    try:
        return float(stored)
    except ValueError:
        return stored


SIDES = named(adapted(TEXTS, store=lambda sides: [_side_text(side) for side in sides], load=lambda stored: tuple(map(_side, stored))))


QUANTITY = Schema(
    Quantity,
    "A measured or modelled quantity.",
    (Field("name", TEXT, "canonical name", NO_UNIT), Field("unit", TEXT, "its unit, as `kPa`, `1`, `N`", NO_UNIT)),
)

RECORDING = Schema(
    Recording,
    "One source file as read, in the units of the model.",
    (
        Field("id", TEXT, "identifier of the recording", NO_UNIT),
        Field("source", TEXT, "POSIX path of the source file, relative to the spec", NO_UNIT),
        Field("columns", named(REALS), "samples that were kept", "[*]"),
        Field("rows_read", COUNT, "samples in the source file"),
        Field("dropped", pairs(INTEGERS), "samples left out, by reason"),
    ),
)

CURVE = Schema(
    Curve,
    "Samples at one value of the level quantity, or of one recording.",
    (
        Field("id", TEXT, "identifier of the curve, as `pressure=150`", NO_UNIT),
        Field("level", OPTIONAL_REAL, "value of the level quantity", "[level]"),
        Field("columns", named(REALS), "samples, row for row", "[*]"),
        Field("held_out", FLAGS, "1 where a sample belongs to the validation data"),
        Field("recordings", TEXTS, "identifiers of the recordings that the samples come from", NO_UNIT),
        Field("at_rest", optional(FLAGS), "1 on the plateau of a step response, where a sample is scored but does not train"),
        Field("origin", optional(INTEGERS), "number of each sample's recording among `recordings`, from 0", NO_UNIT),
    ),
)

DATASET = Schema(
    Dataset,
    "Recordings as read, and the curves made from them.",
    (
        Field("target", TEXT, "the modelled column of the curves", NO_UNIT),
        Field("level", OPTIONAL_TEXT, "the quantity that is constant within a curve", NO_UNIT),
        Field("quantities", named(record(QUANTITY)), "every column's quantity", NO_UNIT),
        Field("recordings", numbered(record(RECORDING)), "files as read", NO_UNIT),
        Field("curves", numbered(record(CURVE)), "curves to model", NO_UNIT),
        Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
    ),
    units=lambda dataset: {
        **{name: quantity.unit for name, quantity in dataset.quantities.items()},
        "level": f"[{dataset.level}]" if dataset.level else NO_UNIT,
    },
)

SEGMENT = Schema(
    Segment,
    "Rows of a training curve that one segment function is fitted to.",
    (
        Field("id", TEXT, "identifier of the segment, as `pressure=150/strain:2`", NO_UNIT),
        Field("curve", TEXT, "identifier of its curve", NO_UNIT),
        Field("cell", CELL, "place along each segmented variable, from 1", NO_UNIT),
        Field("rows", INTEGERS, "row numbers within the curve's training samples, from 0", NO_UNIT),
    ),
)

SEGMENTED_CURVE = Schema(
    SegmentedCurve,
    "A training curve cut up; samples stay in the dataset file.",
    (
        Field("curve", TEXT, "identifier of the curve", NO_UNIT),
        Field("level", OPTIONAL_REAL, "value of the level quantity", "[level]"),
        Field("variables", TEXTS, "segmented variables", NO_UNIT),
        Field("boundaries", numbered(REALS), "segment locations of each variable, both ends included", "[variables.*]"),
        Field("limits", LIMITS, "least and greatest training value of each input", "[*]"),
        Field("segments", numbered(record(SEGMENT)), "segments of the curve", NO_UNIT),
    ),
    units=lambda curve: {f"variables.{place}": f"[{name}]" for place, name in enumerate(curve.variables)},
)

SEGMENTATION = Schema(
    SegmentationFile,
    "Where every training curve is cut.",
    (Field("curves", numbered(record(SEGMENTED_CURVE)), "training curves", NO_UNIT),),
)

SCALING = Schema(
    Scaling,
    "Elementwise linear scaling `z_j = slope_j x_j + intercept_j`, `y = y_slope y_scaled + y_intercept` (M2 eq 8).",
    (
        Field("rule", TEXT, "`unit_square`, `max_abs` or `none`", NO_UNIT),
        Field("placement", TEXT, "where the origin lies, as `left`", NO_UNIT),
        Field("variables", TEXTS, "inputs, in the order of slope and intercept", NO_UNIT),
        Field("slope", REALS, "slope of each input", "[slopes]"),
        Field("intercept", REALS, "intercept of each input"),
        Field("y_slope", REAL, "slope of the output", "[target]"),
        Field("y_intercept", REAL, "intercept of the output", "[target]"),
    ),
    units=lambda scaling: {"slopes": ", ".join(f"1/[{name}]" for name in scaling.variables) or NO_UNIT},
)

SELECTION = Schema(
    Selection,
    "Everything that FROLS found out about one segment (M2 eq 2-7): k terms chosen of M candidates, in scaled coordinates.",
    (
        Field("chosen", INTEGERS, "(k) candidates in the order of selection, from 0", NO_UNIT),
        Field("g", REALS, "(k) coefficients of the orthogonalised regressors"),
        Field("err", REALS, "(k) error reduction ratios"),
        Field("err_sum", REALS, "(k) running sum of err", derived=lambda selection: np.cumsum(selection.err)),
        Field("theta", REALS, "(k) coefficients of the original regressors, A theta = g"),
        Field("theta_error", REALS, "(k) standard errors of theta; NaN without a degree of freedom"),
        Field("a", TABLE, "(k, k) unit upper triangular A, P_chosen = Q A"),
        Field("g_all", TABLE, "(k, M) g of every candidate at every iteration; NaN where already chosen or excluded"),
        Field("err_all", TABLE, "(k, M) err of every candidate at every iteration; NaN where already chosen or excluded"),
        Field("runner_up", INTEGERS, "(k) second best candidate of each iteration, from 0; -1 where there was none", NO_UNIT),
        Field("tied", INTEGERS, "(k) other candidates within 1e-9 of the winner's err"),
        Field("condition", REAL, "2-norm condition number of the chosen regressors"),
        Field("sse", REAL, "residual sum of squares, uncentred"),
        Field("yy", REAL, "total sum of squares, uncentred"),
        Field("samples", COUNT, "samples fitted to"),
        Field("stop", TEXT, "why selection stopped", NO_UNIT),
    ),
)

SEGMENT_FIT = Schema(
    SegmentFit,
    "A segment function: the chosen terms with their scaling, and how they were found.",
    (
        Field("id", TEXT, "identifier of the segment", NO_UNIT),
        Field("curve", TEXT, "identifier of its curve", NO_UNIT),
        Field("cell", CELL, "place along each segmented variable, from 1", NO_UNIT),
        Field("candidates", TEXTS, "names of all M dictionary terms", NO_UNIT),
        Field("terms", TEXTS, "(k) names of the chosen terms, in the order of selection", NO_UNIT, derived=lambda fit: fit.terms),
        Field("scaling", record(SCALING), "scaling of the segment", NO_UNIT),
        Field("selection", record(SELECTION), "how the terms were found", NO_UNIT),
    ),
)

FORMULA_FIT = Schema(
    FormulaFit,
    "A literature model fitted to training data.",
    (
        Field("name", TEXT, "name of the formula", NO_UNIT),
        Field("parameters", pairs(REALS), "fitted parameters; NaN where the fit failed", "those of the formula"),
        Field("errors", pairs(REALS), "standard errors of the parameters; NaN where unknown", "those of the formula"),
        Field("status", TEXT, "`converged`, `at_bound`, `rank_deficient`, `stopped_by_limit` or `failed`", NO_UNIT),
        Field("method", TEXT, "how it was fitted", NO_UNIT),
        Field("rank", COUNT, "rank of the linear problem"),
        Field("condition", REAL, "condition number of the linear problem"),
        Field("sse", REAL, "residual sum of squares", "[target]^2"),
        Field("samples", COUNT, "samples fitted to"),
        Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
    ),
)

FOLD_ERROR = Schema(
    FoldError,
    "Cross-validation error of one choice.",
    (
        Field("choice", TEXT, "what was cross-validated", NO_UNIT),
        Field("rmse", REAL, "pooled error of all left-out samples", "[target]"),
        Field("folds", COUNT, "number of folds"),
    ),
)

STATE_SET = Schema(
    StateSet,
    "States with memory, and everything that their values on a new recording depend on.",
    (
        Field("names", TEXTS, "(s) as `pressure`, `force[k-1]`, `slow(play(pressure, 0.16), 0.3)`", NO_UNIT),
        Field("step", REAL, "time between samples", "s"),
        Field("ranges", LIMITS, "training range of each source of `play`, `stop` and `saturate`, by its name", "that of the source"),
        Field("resonances", LIMITS, "frequency (Hz) and damping ratio that training found, by the name of their source", "Hz, 1"),
        Field("low", REALS, "(s) least training value of each state, scaled to 0; empty where states are not scaled", "that of the state"),
        Field("high", REALS, "(s) greatest training value of each state, scaled to 1; empty likewise", "that of the state"),
        Field("margin", REAL, "how far beyond its training range a scaled state may go, as a fraction of it"),
    ),
)

MEMORY_MODEL = Schema(
    MemoryModel,
    "`output[k] = constant + sum_j theta_j D_j(states[k])`.",
    (
        Field("output", TEXT, "the quantity whose delays are fed back", NO_UNIT),
        Field("states", record(STATE_SET), "states with memory", NO_UNIT),
        Field("terms", TEXTS, "(k) the terms D_j, in the order of selection", NO_UNIT),
        Field("theta", REALS, "(k) coefficients of the terms, of states scaled as `states` says", "those of the terms"),
        Field("theta_error", REALS, "(k) standard errors of theta; NaN without a degree of freedom", "those of the terms"),
        Field("constant", REAL, "the constant", "[target]"),
        Field("limits", SPAN, "least and greatest training output", "[target]"),
    ),
)

MEMORY_FIT = Schema(
    MemoryFit,
    "A model with memory, and how its k terms were chosen of M candidates.",
    (
        Field("model", record(MEMORY_MODEL), "the model", NO_UNIT),
        Field("candidates", TEXTS, "names of all M dictionary terms", NO_UNIT),
        Field("selection", record(SELECTION), "how the terms were found; after pruning, among those kept", NO_UNIT),
        Field("ridge", REAL, "ridge as a fraction of the variance of a standardised candidate; 0 for none"),
        Field("forward", INTEGERS, "candidates chosen before pruning, in their order, from 0", NO_UNIT),
        Field("substitutes", INTEGERS, "(k) candidate that would best replace each term, -1 for none; empty without a ridge", NO_UNIT),
        Field("shares", REALS, "(k) its gain over the term's own; empty without a ridge"),
    ),
)

FIT_RESULT = Schema(
    FitResult,
    "Segment functions, with every intermediate result of their selection.",
    (
        Field("fits", numbered(record(SEGMENT_FIT)), "segment functions", NO_UNIT),
        Field("backbone", optional(record(FORMULA_FIT)), "formula whose residual the segments explain", NO_UNIT),
        Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
        Field("memory", optional(record(MEMORY_FIT)), "model with memory that stands in place of segments", NO_UNIT),
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


def _model() -> Schema:
    return MODEL


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

MODEL: Schema = Schema(
    Model,
    "A fused model that predicts without any other file: `output = backbone + sum_i f_i prod_j w_ij` (M2 eq 9).",
    (
        Field("name", TEXT, "name of the run", NO_UNIT),
        Field("output", record(QUANTITY), "predicted quantity", NO_UNIT),
        Field("inputs", numbered(record(QUANTITY)), "quantities that the model needs", NO_UNIT),
        Field("level", OPTIONAL_TEXT, "the input that is constant within a curve", NO_UNIT),
        Field("variables", TEXTS, "segmented variables", NO_UNIT),
        Field("curves", numbered(record(CURVE_FUNCTION)), "training curves", NO_UNIT),
        Field("fusion", record(FUSION), "how the pieces are joined", NO_UNIT),
        Field("backbone", optional(record(FORMULA_FIT)), "formula that the pieces are added to", NO_UNIT),
        Field("cross_validation", rows(FOLD_ERROR), "errors that decided for or against the pieces on the backbone", NO_UNIT),
        Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
        Field("signals", added(rows(SIGNAL), ()), "inputs that follow from others over time, each after those", NO_UNIT),
        Field("summands", added(numbered(nested(Model, _model)), ()), "models that are added up", NO_UNIT),
        Field("memory", optional(record(MEMORY_MODEL)), "model with memory that stands in place of segments", NO_UNIT),
    ),
    units=lambda model: {
        **{quantity.name: quantity.unit for quantity in (*model.inputs, model.output)},
        **{f"variables.{place}": f"[{name}]" for place, name in enumerate(model.variables)},
        "target": model.output.unit,
        "level": f"[{model.level}]" if model.level else NO_UNIT,
        "aligned": f"[{model.fusion.aligned}]" if model.fusion.aligned else NO_UNIT,
    },
)

SCORE = Schema(
    Score,
    "One row of the score table.",
    (
        Field("model", TEXT, "`mapmore`, or the name of a literature model", NO_UNIT),
        Field("target", TEXT, "the modelled quantity", NO_UNIT),
        Field("split", TEXT, "`train` or `validate`", NO_UNIT),
        Field("curve", TEXT, "`all`, or the identifier of a curve", NO_UNIT),
        Field("n", COUNT, "samples"),
        Field("rmse", REAL, "root of the mean squared error", "[target]"),
        Field("nrmse", REAL, "rmse / normaliser, a fraction"),
        Field("normaliser", REAL, "what the error is divided by", "[target]"),
        Field("normaliser_name", TEXT, "what the normaliser is", NO_UNIT),
        Field("max_abs_error", REAL, "greatest absolute error", "[target]"),
        Field("max_abs_error_fs", REAL, "greatest absolute error as a fraction of the normaliser"),
        Field("r2", REAL, "coefficient of determination"),
        Field("rrse", REAL, "root relative squared error"),
        Field("rrse_one_step", REAL, "the same of predictions from the measured past; NaN without memory"),
    ),
)

VALIDATION = Schema(
    Validation,
    "Predictions of the run's own model and of its competitors, and their scores.",
    (
        Field("predictions", named(numbered(REALS)), "by model, then by curve of the dataset, row for row", "[target]"),
        Field("formulas", named(record(FORMULA_FIT)), "literature models that were fitted", NO_UNIT),
        Field("scores", rows(SCORE), "score table", NO_UNIT),
        Field("units", pairs(TEXTS), "unit of every target", NO_UNIT),
    ),
    units=lambda validation: {**validation.units, **({"target": next(iter(validation.units.values()))} if validation.units else {})},
)
