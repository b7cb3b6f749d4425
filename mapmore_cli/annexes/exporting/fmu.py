"""A model as a functional mock-up unit: FMI 2.0 co-simulation around its C source, with
`modelDescription.xml` and units.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from uuid import UUID

from mapmore_cli.annexes.exporting.c_source import CSource, c_source
from mapmore_cli.annexes.exporting.dialect import rendered, source
from mapmore_cli.domain.foreign import identifiers
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import BaseUnits, Quantity

WRAPPER = ("co-simulation.h", "co-simulation.c")
"""The files around every model; a hyphen keeps their names apart from those of models."""

BITS = "outside_range"
"""The integer output: bit i for input i outside of its training range, and one more where a model
with memory has no value.
"""


@dataclass(frozen=True)
class UnitSources:
    """What a unit is made of: its identifier, files by their place in the archive, and the C files
    that its binary is compiled from.
    """

    name: str
    files: dict[str, str]
    compiled: tuple[str, ...]


def fmu_sources(model: Model, units: Mapping[str, BaseUnits], tool: str) -> UnitSources:
    """Return the texts of a unit; `units` says what is known of the units of the model, `tool` with
    which version of what it is made.

    Raises as `c_source.c_source`.
    """
    written = c_source(model)
    name, compiled = written.name, (f"{written.name}.c", WRAPPER[1])
    texts = {
        f"{name}.h": written.header(),
        f"{name}.c": written.source(),
        **{one: source(one) for one in WRAPPER},
    }
    about = repr([model.name, model.inputs, model.output, tool, *texts.values()])
    guid = str(
        UUID(bytes=hashlib.sha256(about.encode()).digest()[:16])
    )  # the same for the same unit, another one for any other
    variables = list(_variables(written))
    inputs = [one for one in variables if one["causality"] == "input"]
    known = {one["unit"]: _powers(units.get(str(one["unit"]))) for one in variables[:-1]}
    words = {
        **written.words,
        "guid": guid,
        "tool": tool,
        "compiled": compiled,
        "units": known,
        "variables": variables,
        "inputs": inputs,
    }
    description = rendered("modelDescription.xml", **words, about=_about(written))
    sources = {
        f"sources/{one}": text
        for one, text in {**texts, "this-model.h": rendered("this-model.h", **words)}.items()
    }
    return UnitSources(name, {"modelDescription.xml": description, **sources}, compiled)


def _about(written: CSource) -> str:
    step = written.code.step
    if step is None:
        return "The output answers to the present inputs"
    text = (
        f"It takes a sample at the beginning of every step and each {step!r} s; the output is "
        "that of the last sample"
    )
    return text + "; tell it the measured output until it has a value" * bool(
        written.code.kept.fed_back
    )


def _powers(base: BaseUnits | None) -> dict[str, float] | None:
    """Return the attributes of a unit by base units; None where it is not known."""
    if base is None:
        return None
    scale = (("factor", base.factor, 1.0), ("offset", base.offset, 0.0))
    return {**base.powers, **{name: value for name, value, default in scale if value != default}}


def _variables(written: CSource) -> Iterator[dict[str, object]]:
    """Yield inputs, the measured output that the model goes on from, the output, and the bits."""
    model, memory = written.model, written.with_memory
    measured = [
        Quantity(f"{name}_measured", model.output.unit) for name in written.code.kept.fed_back
    ]
    given = (*model.inputs, *measured)
    names = [*identifiers([*(one.name for one in given), model.output.name], [BITS]), BITS]
    changes = "discrete" if memory else "continuous"
    bits = ", ".join(
        f"{1 << place} for {quantity.name}" for place, quantity in enumerate(model.inputs)
    )
    nothing = (
        f", {1 << len(model.inputs)} where there is no value yet or the run has diverged" * memory
    )
    summed = f"0, or the sum of {bits} outside of its training range{nothing}"
    told = "Measured output, which the model goes on from; counts as long as there is no value"
    rows: list[tuple[Quantity, str, str, str, float | None]]
    described = [(one, *_described(written, one)) for one in given]
    rows = [
        (one, "input", changes, told if one in measured else about, start)
        for one, about, start in described
    ]
    rows += [
        (model.output, "output", changes, "The model's value", None),
        (Quantity(BITS, ""), "output", "discrete", summed, None),
    ]
    for name, (quantity, causality, variability, about, start) in zip(names, rows, strict=True):
        text = about if name == quantity.name else f"{quantity.name}. {about}"
        unit = None if name is BITS else quantity.unit
        yield {
            "name": name,
            "about": text,
            "causality": causality,
            "variability": variability,
            "unit": unit,
            "start": start,
        }


def _described(written: CSource, quantity: Quantity) -> tuple[str, float]:
    """Return what is said of an input, and its start: zero, or the end of its training range
    nearest to it, at the lowest level.
    """
    for limit in written.code.limits:
        if limit.inputs == {quantity.name}:
            about = f"Trained from {min(limit.low):.6g} to {max(limit.high):.6g} {quantity.unit}"
            return about, float(min(max(0.0, limit.low[0]), limit.high[0]))
    return "An input", 0.0
