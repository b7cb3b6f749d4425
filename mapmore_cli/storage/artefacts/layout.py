"""What the stored types say beyond their fields, and which kinds of files there are; every type as Markdown (`mapmore schema files`).

Units in brackets name the quantity whose unit applies: `[target]` is the modelled quantity, `[variables.0]` the first segmented variable,
`[*]` the quantity that a part is named after, `[slopes]` one over the unit of each scaled variable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mapmore_cli.domain.fits import FormulaFit, Scaling, SegmentedCurve, SegmentFit, Selection
from mapmore_cli.domain.models import FoldError, Formula, Fusion, Model, MotionFit, Part, Pieces, SegmentFunction, Side
from mapmore_cli.domain.recording import Dataset, Signal
from mapmore_cli.domain.results import FitResult, Validation
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.artefacts.codecs import adapted, named, optional
from mapmore_cli.storage.artefacts.field import Field
from mapmore_cli.storage.artefacts.integrity import Invalid
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.schema import LAYOUTS, REALS, TEXT, TEXTS, Layout, Schema, rows, schema_of, variant


@dataclass(frozen=True)
class SegmentationFile:
    """Where every training curve is cut."""

    curves: Annotated[tuple[SegmentedCurve, ...], "training curves"]


def _side(word: str) -> Side:
    try:
        return float(word)
    except ValueError:
        return word


SIDES = adapted(
    TEXTS,
    store=lambda sides: [side if isinstance(side, str) else repr(float(side)) for side in sides],
    load=lambda words: tuple(map(_side, words)),
)


def _defining(text: str) -> str:
    """Return the text; Invalid where it is not empty and defines no formula."""
    try:
        if text:
            literature.get(text)
    except (KeyError, ValueError) as fault:
        raise Invalid("definition", str(fault)) from fault
    return text


def _level_unit(of: Dataset | Formula) -> dict[str, str]:
    return {"level": f"[{of.level}]" if of.level else NO_UNIT}


def _variable_units(of: SegmentedCurve | Pieces) -> dict[str, str]:
    return {f"variables.{place}": f"[{name}]" for place, name in enumerate(of.variables)}


def _target_units(of: Validation) -> dict[str, str]:
    first = next(iter(of.units.values()), None)
    return dict(of.units) if first is None else {**of.units, "target": first}


LAYOUTS |= {
    Dataset: Layout(
        always=("notes",),
        units=lambda dataset: {**{name: quantity.unit for name, quantity in dataset.quantities.items()}, **_level_unit(dataset)},
    ),
    SegmentedCurve: Layout(units=_variable_units),
    Scaling: Layout(units=lambda scaling: {"slopes": ", ".join(f"1/[{name}]" for name in scaling.variables) or NO_UNIT}),
    Selection: Layout(derived=(Field("err_sum", REALS, "(k) running sum of err", derived=lambda selection: np.cumsum(selection.err)),)),
    SegmentFit: Layout(
        derived=(Field("terms", TEXTS, "(k) names of the chosen terms, in the order of selection", NO_UNIT, derived=lambda fit: fit.terms),)
    ),
    FormulaFit: Layout({"definition": adapted(TEXT, store=str, load=_defining)}, always=("notes",)),
    MotionFit: Layout(always=("notes",)),
    FitResult: Layout({"body": optional(variant({kind.name: kind.fit for kind in kinds() if kind.fit is not None}))}, always=("notes",)),
    SegmentFunction: Layout(always=("limits",)),
    Fusion: Layout(
        {"extrapolation": named(SIDES)},
        always=("transition", "z_s", "levels", "shrink"),
        first=("transition", "z_s", "extrapolation", "levels", "aligned", "shrink", "hold", "domain"),
    ),
    Pieces: Layout(
        {"cross_validation": rows(FoldError)},
        always=("cross_validation",),
        units=lambda pieces: {
            **_variable_units(pieces),
            **_level_unit(pieces),
            "aligned": f"[{pieces.fusion.aligned}]" if pieces.fusion.aligned else NO_UNIT,
        },
    ),
    Formula: Layout(units=_level_unit),
    Part: Layout(always=("sign", "inputs")),
    Model: Layout(
        {"body": variant({kind.name: kind.body for kind in kinds()}), "signals": rows(Signal)},
        always=("signals", "notes"),
        units=lambda model: {**{quantity.name: quantity.unit for quantity in (*model.inputs, model.output)}, "target": model.output.unit},
    ),
    Validation: Layout({"scores": rows(Score)}, units=_target_units),
}


def stored_types() -> list[Schema]:
    """Return the schemas of what files hold, and of all that these are made of, each once, parts before wholes."""
    seen: set[type] = set()

    def walk(type_: type) -> None:
        if type_ not in seen:
            seen.add(type_)
            schema = schema_of(type_)
            for field in schema.fields:
                for part in field.codec.types:
                    walk(part)
            in_order.append(schema)

    in_order: list[Schema] = []
    for root in (Dataset, SegmentationFile, FitResult, Model, Validation):
        walk(root)
    return in_order


def described() -> str:
    """Return a section for every stored type; docs/file-format.md says what the short words mean."""
    return "".join(map(_section, stored_types()))


def _section(schema: Schema) -> str:
    rows_ = "".join(map(_row, schema.fields))
    return f"### {schema.type.__name__}\n\n{schema.summary}\n\n| name | stored as | unit | what it is |\n|---|---|---|---|\n{rows_}\n"


def _row(field: Field) -> str:
    unit = NO_UNIT if field.unit == NO_UNIT else f"`{field.unit}`"
    remark = " (derived)" if field.derived else ""
    what = f"{field.description}{remark}".replace("|", "\\|")
    return f"| `{field.name}` | {field.codec.form} | {unit} | {what} |\n"
