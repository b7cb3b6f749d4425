"""Predictions and scores."""

from __future__ import annotations

from mapmore_cli.domain.scores import METRICS, Score, Validation
from mapmore_cli.storage.artefacts.codecs import added, named, numbered, pairs, text
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import ANY_REAL, ANY_REALS, COUNT, TEXT, TEXTS
from mapmore_cli.storage.artefacts.layout.fits import FORMULA_FIT
from mapmore_cli.storage.artefacts.layout.motion import MOTION_FIT
from mapmore_cli.storage.artefacts.schema import Field, Schema, record, rows

SCORE = Schema(
    Score,
    "One row of the score table.",
    (
        Field("model", TEXT, "`mapmore`, or the name of a literature model", NO_UNIT),
        Field("target", TEXT, "the modelled quantity", NO_UNIT),
        Field("split", text(words=("train", "validate")), "`train` or `validate`", NO_UNIT),
        Field("curve", TEXT, "`all`, or the identifier of a curve", NO_UNIT),
        Field("n", COUNT, METRICS["n"]),
        Field("rmse", ANY_REAL, METRICS["rmse"], "[target]"),
        Field("nrmse", ANY_REAL, METRICS["nrmse"]),
        Field("normaliser", ANY_REAL, METRICS["normaliser"], "[target]"),
        Field("normaliser_name", TEXT, "what the normaliser is", NO_UNIT),
        Field("max_abs_error", ANY_REAL, METRICS["max_abs_error"], "[target]"),
        Field("max_abs_error_fs", ANY_REAL, METRICS["max_abs_error_fs"]),
        Field("r2", ANY_REAL, METRICS["r2"]),
        Field("rrse", ANY_REAL, METRICS["rrse"]),
        Field("rrse_one_step", ANY_REAL, METRICS["rrse_one_step"]),
        Field("r_uncentred", ANY_REAL, METRICS["r_uncentred"]),
    ),
)

VALIDATION = Schema(
    Validation,
    "Predictions of the run's own model and of its competitors, and their scores.",
    (
        Field("predictions", named(numbered(ANY_REALS)), "by model, then by curve of the dataset, row for row", "[target]"),
        Field("formulas", named(record(FORMULA_FIT)), "literature models that were fitted", NO_UNIT),
        Field("scores", rows(SCORE), "score table", NO_UNIT),
        Field("units", pairs(TEXTS), "unit of every target", NO_UNIT),
        Field("motions", added(named(record(MOTION_FIT)), {}), "models of motion among the competitors, and how they were found", NO_UNIT),
    ),
    units=lambda validation: {**validation.units, **({"target": next(iter(validation.units.values()))} if validation.units else {})},
)
