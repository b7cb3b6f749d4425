"""Recordings and the curves made from them."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.domain.arrays import in_blocks
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.storage.artefacts.codecs import shown
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import (
    NAME,
    TEXTS,
)
from mapmore_cli.storage.artefacts.layout.derived import stored
from mapmore_cli.storage.artefacts.schema import Fault

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
