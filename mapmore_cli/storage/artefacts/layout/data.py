"""Recordings and the curves made from them."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.domain.blocks import in_blocks
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.storage.artefacts.codecs import added, named, numbered, optional, pairs, shown
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import (
    ANY_REALS,
    COUNT,
    FLAGS,
    INDICES,
    LIMITS,
    NAME,
    OPTIONAL_REAL,
    OPTIONAL_TEXT,
    TEXT,
    TEXTS,
)
from mapmore_cli.storage.artefacts.schema import Fault, Field, Schema, record

QUANTITY = Schema(
    Quantity,
    "A measured or modelled quantity.",
    (Field("name", NAME, "canonical name", NO_UNIT), Field("unit", TEXT, "its unit, as `kPa`, `1`, `N`", NO_UNIT)),
)

RECORDING = Schema(
    Recording,
    "One source file as read, in the units of the model.",
    (
        Field("id", TEXT, "identifier of the recording", NO_UNIT),
        Field("source", TEXT, "POSIX path of the source file, relative to the spec", NO_UNIT),
        Field("columns", named(ANY_REALS), "(n) samples that were kept", "[*]"),
        Field("rows_read", COUNT, "samples in the source file"),
        Field("dropped", pairs(INDICES), "samples left out, by reason"),
        Field("log", added(TEXT, ""), "identifier of the log that this is a piece of; empty where it is the whole log", NO_UNIT),
    ),
)


def _curve_faults(curve: Curve) -> Iterator[Fault]:
    last = -1 if curve.origin is None else max((int(block.max()) for block in in_blocks(curve.origin)), default=-1)
    if last >= len(curve.recordings):
        yield "origin", f"names recording {last} of {len(curve.recordings)}"


CURVE = Schema(
    Curve,
    "Samples at one value of the level quantity, or of one recording.",
    (
        Field("id", TEXT, "identifier of the curve, as `pressure=150`", NO_UNIT),
        Field("level", OPTIONAL_REAL, "value of the level quantity", "[level]"),
        Field("columns", named(ANY_REALS), "(n) samples, row for row", "[*]"),
        Field("held_out", FLAGS, "(n) 1 where a sample belongs to the validation data"),
        Field("recordings", TEXTS, "identifiers of the recordings that the samples come from", NO_UNIT),
        Field("at_rest", optional(FLAGS), "(n) 1 on the plateau of a step response, where a sample is scored but does not train"),
        Field("origin", optional(INDICES), "(n) number of each sample's recording among `recordings`, from 0", NO_UNIT),
        Field("measured", added(LIMITS, {}), "range of each quantity over the training recordings, where samples are branches", "[*]"),
    ),
    rule=_curve_faults,
)


def _dataset_faults(dataset: Dataset) -> Iterator[Fault]:
    for field, name in (("target", dataset.target), ("level", dataset.level)):
        if name is not None and name not in dataset.quantities:
            yield field, f"is {shown(name)}, which is none of the quantities"
    for place, curve in enumerate(dataset.curves):
        if dataset.target not in curve.columns:
            yield f"curves/{place:03d}/columns", f"has no {shown(dataset.target)}, which is the target"
        if strange := [name for name in curve.columns if name not in dataset.quantities]:
            yield f"curves/{place:03d}/columns", f"has {shown(strange[0])}, which is none of the quantities"


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
    rule=_dataset_faults,
)
