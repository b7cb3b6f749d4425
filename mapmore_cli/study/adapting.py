"""A family's model, adapted to a specimen by few points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.modelling.literature.family import adapted, family_of
from mapmore_cli.modelling.literature.settings import is_family
from mapmore_cli.storage.tables.table import TableRequest, locate_columns
from mapmore_cli.study.prediction.records import fields_of, records, values_of


def adapt(model: Model, lines: Iterable[str] | None, label: str, constants: Mapping[str, float]) -> Model:
    """Return a model of pressure and strain for one specimen of the family; without `lines`, by its dimension alone.

    `lines` are those of a CSV table with pressure, strain and the output in the model's units; `constants` give what specimens differ in.
    Rows with an empty field are left out. The intervals stay those of the family, and a note says so.

    Raises UsageError for a model that is no family, or without its dimension; DataError where the table is empty or lacks a column.
    """
    of = dimension_of(model)
    assert isinstance(model.body, Formula)
    if set(constants) != {of}:
        raise UsageError(f"adapt needs the {of} of the specimen, and nothing else", f"give it as `--set {of}=0.25`")
    names = ("pressure", "strain", model.output.name)
    columns = {name: np.empty(0) for name in names} if lines is None else _columns(lines, label, names)
    target = columns.pop(model.output.name)
    fit = adapted(model.body.fit, columns, target, constants[of])
    ranges = tuple(replace(one, limits={name: ends for name, ends in one.limits.items() if name != of}) for one in model.body.ranges)
    inputs = tuple(quantity for quantity in model.inputs if quantity.name != of)
    known = model.body.ranges[0].limits[of]
    notes = fit.notes
    if not known[0] <= constants[of] <= known[1]:
        notes = (*notes, f"{of} {constants[of]:g} lies outside of the family's {known[0]:g} to {known[1]:g}")
    if model.left_out is not None:
        notes = (*notes, f"its intervals are those of the family, by {model.left_out.curves} specimens, whatever was measured of this one")
    return replace(model, inputs=inputs, body=replace(model.body, fit=fit, ranges=ranges), notes=notes)


def dimension_of(model: Model) -> str:
    """Return what specimens of a family differ in; UsageError for a model that is no family."""
    if isinstance(model.body, Formula) and is_family(model.body.fit.definition):
        return family_of(model.body.fit.definition).settings.of
    raise UsageError(
        f"the model {model.name} is of one muscle, and adapt needs that of a family, which is learnt from several",
        "give each muscle's files what it differs in, as `set: {rest_length: 83 mm}`, and write `model: {family: {of: rest_length}}`; "
        "or fit this muscle by itself: `mapmore init` with its files",
    )


def _columns(lines: Iterable[str], label: str, wanted: tuple[str, ...]) -> dict[str, Array]:
    rows = list(records(lines, label))
    if len(rows) < 2:
        raise DataError(f"{label}: the table is empty", f"its first line has to name {', '.join(wanted)}")
    names = [cell.strip() for cell in rows[0].cells]
    places = locate_columns(TableRequest(label, wanted, header=True), names, len(names))
    fields = [fields_of(row, len(names), label) for row in rows[1:]]
    columns = {name: values_of(rows[1:], fields, places[name], name, label) for name in wanted}
    known = np.logical_and.reduce([np.isfinite(values) for values in columns.values()])
    return {name: values[known] for name, values in columns.items()}
