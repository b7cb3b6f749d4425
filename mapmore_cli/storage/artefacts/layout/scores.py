"""Predictions and scores."""

from __future__ import annotations

from mapmore_cli.domain.scores import Score, Validation
from mapmore_cli.storage.artefacts.codecs import named, numbered, pairs
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import COUNT, REAL, REALS, TEXT, TEXTS
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT
from mapmore_cli.storage.artefacts.schema import Field, Schema, record, rows

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
