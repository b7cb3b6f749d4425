"""Adapt the model of a family to one specimen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import columns_at
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.modelling.literature.family import adapted, family_of
from mapmore_cli.modelling.literature.own import is_family
from mapmore_cli.modelling.memory.records import complete
from mapmore_cli.pipeline.records import Sheet


def names_of_points(model: Model) -> tuple[str, str, str]:
    """Return the names of the columns that a table of measured points for `adapt` must have."""
    return "pressure", "strain", model.output.name


def adapt(
    model: Model, lines: Iterable[str] | None, label: str, constants: Mapping[str, float]
) -> Model:
    """Return a model for one specimen of a family, with the inputs pressure and strain.

    `constants` gives the dimension of the specimen, that is, the value of the quantity in which the
    specimens of the family differ. `lines` is a CSV table of measured points with pressure, strain
    and the output in the model's units; rows with an empty field are left out. Without `lines`, the
    model follows from the dimension alone. If the family has intervals, the model keeps these
    intervals, and a note says so.

    Raises UsageError if the model is no family, or if `constants` lacks the dimension of the
    specimen or has other entries. Raises DataError if the table is empty or lacks a column.
    """
    of = dimension_of(model)
    body = model.body_of(Formula)
    low, high = body.ranges[0].limits[of]
    if set(constants) != {of}:
        unit = next(quantity.unit for quantity in model.inputs if quantity.name == of)
        remedy = (
            f"give it, for example `--set {of}={(low + high) / 2:.3g}`, in {unit}; the "
            f"family covers {low:g} to {high:g}"
        )
        raise UsageError(f"adapt needs the {of} of the specimen, and no other constant", remedy)
    names = names_of_points(model)
    columns = {name: np.empty(0) for name in names}
    if lines is not None:
        table = Sheet(lines, label, ", ".join(names))
        places, block = table.places(names), list(table.rows)
        if not block:
            raise table.empty()
        columns = table.values(block, places)
        known = complete(columns.values(), len(block))
        columns = columns_at(columns, known)
    target = columns.pop(model.output.name)
    fit = adapted(body.fit, columns, target, constants[of])
    ranges = tuple(
        replace(
            curve_range,
            limits={name: ends for name, ends in curve_range.limits.items() if name != of},
        )
        for curve_range in body.ranges
    )
    inputs = tuple(quantity for quantity in model.inputs if quantity.name != of)
    notes = [*fit.notes]
    if not low <= constants[of] <= high:
        notes.append(
            f"{of} {constants[of]:g} lies outside the range of the family, {low:g} to {high:g}"
        )
    if model.left_out is not None:
        notes.append(
            "its intervals are those of the family, which come from "
            f"{model.left_out.curves} specimens; the samples of this specimen do not change "
            "them"
        )
    return replace(
        model, inputs=inputs, body=replace(body, fit=fit, ranges=ranges), notes=tuple(notes)
    )


def dimension_of(model: Model) -> str:
    """Return the quantity in which the specimens of a family differ. Raises UsageError for a model
    that is no family.
    """
    if isinstance(model.body, Formula) and is_family(model.body.fit.definition):
        return family_of(model.body.fit.definition).settings.of
    raise UsageError(
        f"adapt needs a family model, which is fitted to several muscles, but {model.name} "
        "is fitted to one",
        "give the files of each muscle the property that differs, for example `set: "
        "{rest_length: 83 mm}`, and write `model: {family: {of: rest_length}}`; or "
        "make a model of this muscle alone: `mapmore init` with its files",
    )
