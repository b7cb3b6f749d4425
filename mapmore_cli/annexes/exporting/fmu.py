"""Write a model as a functional mock-up unit: FMI 2.0 or 3.0 co-simulation around its C source,
with `modelDescription.xml` and units.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple
from uuid import UUID

from mapmore_cli import __version__
from mapmore_cli.annexes.exporting.c_source import CSource, c_source, functions
from mapmore_cli.annexes.exporting.templates import Wanted, rendered_template, source, with_notice
from mapmore_cli.annexes.exporting.verifying import (
    CompilerMissing,
    built,
    library_place,
    training_ends,
    verify_program,
)
from mapmore_cli.annexes.exporting.words import identifiers
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import BaseUnits, Quantity
from mapmore_cli.study.units import base_units

WRAPPERS = {
    2: ("unit.h", "co-simulation.h", "co-simulation.c"),
    3: ("unit.h", "co-simulation-3.c"),
}
"""Source files of every FMU, by the version of the standard. The last file is compiled together
with the C code of the model. No model may have the name of one of these files.
"""

BITS = "outside_range"
"""Name of the integer output: bit i is set if input i is outside its training range; a further bit
is set if a model with memory has no value.
"""


@dataclass(frozen=True)
class UnitSources:
    """Contents of an FMU: its identifier, its description, its sources by name, and the files from
    which its binary is compiled.
    """

    name: str
    description: str
    sources: dict[str, str]
    compiled: tuple[str, ...]


class Variable(NamedTuple):
    """A variable of an FMU, with the attributes that FMI gives to a variable."""

    name: str
    about: str
    causality: str
    variability: str
    unit: str | None
    start: float | None = None


def unit_file(model: Model, wanted: Wanted, standard: int = 2) -> dict[str, bytes]:
    """Return a functional mock-up unit as a zip file without dates: its sources, and the binary for
    this machine if there is a compiler.
    """
    unit = fmu_sources(model, f"mapmore {__version__}", standard)
    files = {"modelDescription.xml": unit.description.encode()}
    files |= {
        f"sources/{name}": with_notice(name, text).encode() for name, text in unit.sources.items()
    }
    try:
        if wanted.verify:
            test, others = "verify-unit.c", unit.compiled
            if standard == 3:  # the test program for FMI 3 contains the other sources already
                test, others = "verify-unit-3.c", unit.compiled[:1]
            verify_program(model, {**unit.sources, test: source(test)}, [*others, test])
        files[library_place(unit.name, standard)] = built(unit.sources, unit.compiled)
    except CompilerMissing as reason:
        wanted.warn(
            f"{reason}: the FMU contains only source code, which the program that imports it must "
            "compile; export it again with a C compiler to add a binary"
        )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in files.items():
            # the default date of 1980 is kept, so that the same model gives the same bytes
            entry = zipfile.ZipInfo(name)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # always 3 (Unix), so that every system writes the same bytes
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, data)
    return {f"{unit.name}{'' if standard == 2 else '_fmi3'}.fmu": stream.getvalue()}


def fmu_sources(model: Model, tool: str, standard: int = 2) -> UnitSources:
    """Return the source files in an FMU for FMI 2 or 3; `tool` is the program that makes it, with
    its version.

    Raises the same errors as `c_source.c_source`.
    """
    written = c_source(model)
    wrapper = WRAPPERS[standard]
    name, compiled = written.name, (f"{written.name}.c", wrapper[-1])
    texts = {template: source(template) for template in wrapper}
    header = rendered_template("model.h", **written.words)
    texts = {f"{name}.h": header, f"{name}.c": functions(written.words), **texts}
    about = repr([model.name, model.inputs, model.output, tool, *texts.values()])
    # equal FMUs get the same identifier, and different FMUs get different ones
    guid = str(UUID(bytes=hashlib.sha256(about.encode()).digest()[:16]))
    variables = list(_variables(written, [BITS] if standard == 2 else [BITS, "time"]))
    words = {
        **written.words,
        "guid": guid,
        "tool": tool,
        "compiled": compiled,
        "units": {
            variable.unit: _powers(base_units(str(variable.unit))) for variable in variables[:-1]
        },
        "variables": variables,
        "inputs": [variable for variable in variables if variable.causality == "input"],
    }
    texts["this-model.h"] = rendered_template("this-model.h", **words)
    if standard == 3:
        texts["buildDescription.xml"] = rendered_template("buildDescription.xml", **words)
    form = "modelDescription.xml" if standard == 2 else "modelDescription3.xml"
    description = rendered_template(form, **words, about=_about(written))
    return UnitSources(name, description, texts, compiled)


def input_names(model: Model) -> list[str]:
    """Return the names of the inputs of an FMU, in order."""
    written = c_source(model)
    return [
        variable.name
        for variable in _variables(written, [BITS, "time"])
        if variable.causality == "input"
    ]


def _about(written: CSource) -> str:
    step = written.program.step
    if step is None:
        return "The output depends on the present inputs only"
    text = (
        f"It takes a sample at the beginning of every step and each {step!r} s; the output is "
        "that of the last sample"
    )
    return text + "; set the measured output until the model has a value" * bool(
        written.program.kept.fed_back
    )


def _powers(base: BaseUnits | None) -> dict[str, float] | None:
    """Return the attributes with which FMI describes a unit of measurement by SI base units; None
    if unknown.
    """
    if base is None:
        return None
    scale = (("factor", base.factor, 1.0), ("offset", base.offset, 0.0))
    return {**base.powers, **{name: value for name, value, default in scale if value != default}}


def _variables(written: CSource, reserved: list[str]) -> Iterator[Variable]:
    """Yield the variables of an FMU: the inputs, the measured output if the model needs it to
    start, the output, and `outside_range`, whose bits show which inputs are outside their training
    range. No input and no measured output gets a name that is in `reserved`.
    """
    model, memory = written.words["model"], written.words["memory"]
    measured = [
        Quantity(f"{name}_measured", model.output.unit) for name in written.program.kept.fed_back
    ]
    measurable, ends = (*model.inputs, *measured), training_ends(model)
    names = identifiers([*(quantity.name for quantity in measurable), model.output.name], reserved)
    changes = "discrete" if memory else "continuous"
    for quantity, name in zip((*measurable, model.output), names, strict=True):
        start: float | None = 0.0
        causality, about = "input", "An input"
        low, high = ends.get(quantity.name, ([], []))
        if quantity is model.output:
            causality, about, start = "output", "The model's value", None
        elif quantity in measured:
            about = (
                "Measured output with which the model starts; it is used until the model has a "
                "value"
            )
        elif low:
            # start at the value nearest to zero in the training range of the lowest level
            start = float(min(max(0.0, low[0]), high[0]))
            about = f"Trained from {min(low):.6g} to {max(high):.6g} {quantity.unit}"
        about = about if name == quantity.name else f"{quantity.name}. {about}"
        yield Variable(name, about, causality, changes, quantity.unit, start)
    bits = ", ".join(
        f"{1 << place} for {quantity.name}" for place, quantity in enumerate(model.inputs)
    )
    summed = f"0, or the sum of {bits} outside of its training range"
    if memory:
        nothing = 1 << len(model.inputs)
        summed += f", {nothing} if there is no value yet or the run has diverged"
    yield Variable(BITS, summed, "output", "discrete", None)
