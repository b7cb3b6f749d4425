"""Recordings and the curves made from them."""

from __future__ import annotations

from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.storage.artefacts.codecs import added, named, numbered, optional, pairs
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import COUNT, FLAGS, INTEGERS, OPTIONAL_REAL, OPTIONAL_TEXT, REALS, TEXT, TEXTS
from mapmore_cli.storage.artefacts.schema import Field, Schema, record

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
        Field("log", added(TEXT, ""), "identifier of the log that this is a piece of; empty where it is the whole log", NO_UNIT),
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
