"""Write the columns of a study into its draft, and the strain that follows from a length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapmore_cli.annexes.drafting.columns import Table
from mapmore_cli.annexes.drafting.draft import Conditions, Draft
from mapmore_cli.annexes.drafting.understanding import Understood
from mapmore_cli.study.units import can_convert, is_canonical


def with_columns(draft: Draft, known: Understood, target: str, table: Table) -> Draft:
    """Return the draft with the columns for one target and a remark on columns that are not used.
    Quantities without a default unit, for example a displacement, keep the units of their columns.
    """
    used = {place for column in known.columns.values() for place in column.places}
    left = ", ".join(
        f"{column_of_table.called} ({known.left_out[column]})"
        if column in known.left_out
        else column_of_table.called
        for column, column_of_table in table.items()
        if column not in used
    )
    others = {*known.targets} - {target}
    columns = {name: column for name, column in known.columns.items() if name not in others}
    entries = {name: column.as_spec() for name, column in columns.items()}
    is_sure = not any(
        column_of_table.unread for column, column_of_table in table.items() if column not in used
    )
    draft = draft.with_data("columns", entries, f"left out: {left}" if left else None, is_sure)
    units = {
        name: "kPa" if can_convert(column.unit, "kPa") else column.unit
        for name, column in columns.items()
        if column.unit != "1"
    } | {condition.quantity: condition.unit for condition in known.conditions if condition.unit}
    if units := {name: unit for name, unit in units.items() if not is_canonical(name)}:
        draft = draft.with_section("units", units)
    if known.apart:
        of = known.apart if len(known.apart) > 1 else known.apart[0]
        draft = draft.with_data("recordings", {"of": of}, "you; lags stay within a recording")
    if computed := [
        text for column in table.values() if column.column in used for text in column.summaries
    ]:
        draft = draft.with_data("missing", {"tokens": computed})
    if "time" in columns:
        draft = draft.without_data("sample_time")
    for name, column in columns.items():
        draft = draft.noted(("data", "columns", name), column.why, column.sure)
    return replace(
        draft, raw={column.column: column.values for column in table.values() if column.values}
    )


def with_strain(draft: Draft, length: float, conditions: Conditions) -> tuple[Draft, str]:
    """Return the draft with a strain that is computed from the column of a length or a
    displacement, and the name of this column. `length` is the length of the muscle, in m. If the
    strain is known already, or if there is no length and no displacement, only the length of the
    muscle is added to the draft, and the name is empty.

    The strain is positive in contraction: a displacement gets a minus sign if its value with the
    largest magnitude is negative. `conditions` are the values in names of files.
    """
    draft = draft.with_section("muscle", {"length": length})
    columns = draft.data["columns"]
    known = {*columns, *conditions}
    measured = next((name for name in ("length", "displacement") if name in known), None)
    if "strain" in known or measured is None:
        return draft, ""
    turned = ""
    if measured == "displacement":
        entry = columns.get(measured, {})
        pooled = np.concatenate(draft.raw[entry["column"]] if entry else [conditions[measured]])
        pooled = pooled * entry.get("scale", 1.0) + entry.get("offset", 0.0)
        turned = "-" if -pooled.min() > pooled.max() else ""
    rules = {
        "length": f"({length:g} - length)/{length:g}",
        "displacement": f"{turned}displacement/{length:g}",
    }
    return draft.with_data(
        "derive",
        {"strain": rules[measured]},
        "computed with the length that was given; contraction is positive",
        False,
    ), measured
