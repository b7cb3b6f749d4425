"""A model as a functional mock-up unit: FMI 2.0 co-simulation around its C source, with `modelDescription.xml` and units."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from uuid import UUID
from xml.sax.saxutils import quoteattr

from mapmore_cli.domain.foreign import identifiers, xml_text
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import BaseUnits, Quantity
from mapmore_cli.exporting.c_source import Source, source_of
from mapmore_cli.modelling.program.statements import Program

WRAPPER = ("co-simulation.h", "co-simulation.c")
"""The files around every model; a hyphen keeps their names apart from those of models."""

CONFIGURATION = "this-model.h"

BITS = "outside_range"
"""The integer output: bit i for input i outside of its training range, and one more where a model with memory has no value."""


@dataclass(frozen=True)
class UnitSources:
    """What a unit is made of: its identifier, files by their place in the archive, and the C files that its binary is compiled from."""

    name: str
    files: dict[str, str]
    compiled: tuple[str, ...]


def fmu_sources(model: Model, units: Mapping[str, BaseUnits], tool: str) -> UnitSources:
    """Return the texts of a unit; `units` says what is known of the units of the model, `tool` with which version of what it is made.

    Raises
    ------
    UsageError
        Where the model's name has nothing that C allows, or it has too many inputs.
    DataError
        Where a part of the model is no closed expression.
    """
    unit = _Unit(source_of(model), units, tool)
    sources = {f"sources/{name}": text for name, text in {**unit.texts, CONFIGURATION: unit.configuration()}.items()}
    return UnitSources(unit.name, {"modelDescription.xml": unit.description(), **sources}, (f"{unit.name}.c", WRAPPER[1]))


@dataclass(frozen=True)
class _Unit:
    source: Source
    units: Mapping[str, BaseUnits]
    tool: str

    @property
    def name(self) -> str:
        return self.source.name

    @property
    def model(self) -> Model:
        return self.source.model

    @property
    def code(self) -> Program:
        return self.source.code

    @property
    def with_memory(self) -> bool:
        return self.source.with_memory

    @property
    def given(self) -> tuple[Quantity, ...]:
        """Inputs of the unit: the model's, and the measured output that it goes on from."""
        return (*self.model.inputs, *(Quantity(f"{name}_measured", self.model.output.unit) for name in self.code.kept.fed_back))

    @cached_property
    def texts(self) -> dict[str, str]:
        """The model in C, and what is around it, by name."""
        around = {name: files(__package__).joinpath("sources", name).read_text(encoding="utf-8") for name in WRAPPER}
        return {f"{self.name}.h": self.source.header(), f"{self.name}.c": self.source.source(), **around}

    @property
    def guid(self) -> str:
        """The same for the same unit, another one for any other."""
        about = repr([self.model.name, self.model.inputs, self.model.output, self.tool, *self.texts.values()])
        return str(UUID(bytes=hashlib.sha256(about.encode()).digest()[:16]))

    def configuration(self) -> str:
        """Return what the wrapper has to know of the model."""
        name, prefix, step = self.name, self.name.upper(), self.code.step
        measured = bool(self.code.kept.fed_back)
        lines = ["/* What the functions of FMI have to know of the model. */", f'#include "{name}.h"', ""]
        lines += [f'#define MODEL_GUID "{self.guid}"', f"#define INPUTS {prefix}_INPUTS"]
        lines += [f"#define MEASURED {int(measured)}", f"#define MEMORY {int(self.with_memory)}"]
        if step is not None:
            lines += [f"#define SAMPLE_TIME {prefix}_SECONDS", f'#define SAMPLE_TIME_TEXT "{step!r}"']
        starts = ", ".join(repr(self.start(quantity)) for quantity in self.given)
        lines += ["", f"typedef {f'{name}_state' if self.with_memory else 'char'} model_state;", ""]
        lines += [f"static const double model_start[] = {{{starts}}};", ""]
        lines += _c_function("void model_reset(model_state *s)", f"{name}_reset(s);" if self.with_memory else "*s = 0;")
        call = [f"return {name}_step(s, in, out);"] if self.with_memory else ["(void)s;", f"return {name}_eval(in, out);"]
        lines += _c_function("int model_step(model_state *s, const double *in, double *out)", *call)
        if self.with_memory:
            tell = [f"{name}_measured(s, in[INPUTS]);"] if measured else ["(void)s;", "(void)in;"]
            lines += _c_function("void model_measured(model_state *s, const double *in)", *tell)
        return "\n".join(lines)

    def start(self, quantity: Quantity) -> float:
        """Zero, or the end of the training range that is nearest to it, at the lowest level."""
        for limit in self.code.limits:
            if limit.inputs == {quantity.name}:
                return float(min(max(0.0, limit.low[0]), limit.high[0]))
        return 0.0

    def description(self) -> str:
        """`modelDescription.xml`."""
        about = _attributes(
            fmiVersion="2.0",
            modelName=self.model.name,
            guid=self.guid,
            description=self._about(),
            generationTool=self.tool,
            variableNamingConvention="flat",
        )
        parts = (self._simulation(), self._units(), self._experiment(), self._variables(), self._structure())
        lines = ['<?xml version="1.0" encoding="UTF-8"?>', f"<fmiModelDescription{about}>"]
        return "\n".join([*lines, *(f"  {line}" for part in parts for line in part), "</fmiModelDescription>", ""])

    def _about(self) -> str:
        if self.code.step is None:
            return "The output answers to the present inputs"
        text = f"It takes a sample at the beginning of every step and each {self.code.step!r} s; the output is that of the last sample"
        return text + "; tell it the measured output until it has a value" * bool(self.code.kept.fed_back)

    def _simulation(self) -> Iterator[str]:
        able = {
            "canHandleVariableCommunicationStepSize": not self.with_memory,
            "canInterpolateInputs": False,
            "canRunAsynchronuously": False,
            "canBeInstantiatedOnlyOncePerProcess": False,
            "canNotUseMemoryManagementFunctions": False,
            "canGetAndSetFMUstate": True,
            "canSerializeFMUstate": True,
            "providesDirectionalDerivative": False,
        }
        texts = {name: str(value).lower() for name, value in able.items()}
        yield f"<CoSimulation{_attributes(modelIdentifier=self.name, maxOutputDerivativeOrder='0', **texts)}>"
        yield "  <SourceFiles>"
        for name in (f"{self.name}.c", WRAPPER[1]):
            yield f"    <File{_attributes(name=name)}/>"
        yield "  </SourceFiles>"
        yield "</CoSimulation>"

    def _units(self) -> Iterator[str]:
        yield "<UnitDefinitions>"
        for unit in dict.fromkeys(quantity.unit for quantity in (*self.given, self.model.output)):
            base = self.units.get(unit)
            if base is None:
                yield f"  <Unit{_attributes(name=unit)}/>"
                continue
            numbers: dict[str, float] = {**base.powers}
            numbers |= {name: value for name, value, same in (("factor", base.factor, 1.0), ("offset", base.offset, 0.0)) if value != same}
            yield f"  <Unit{_attributes(name=unit)}>"
            yield f"    <BaseUnit{_attributes(**{name: repr(number) for name, number in numbers.items()})}/>"
            yield "  </Unit>"
        yield "</UnitDefinitions>"

    def _experiment(self) -> Iterator[str]:
        if self.code.step is not None:
            yield f"<DefaultExperiment{_attributes(startTime='0', stepSize=repr(self.code.step))}/>"

    def _variables(self) -> Iterator[str]:
        changes = "discrete" if self.with_memory else "continuous"
        inputs = [(one.name, "input", changes, self._about_input(one), _real(one, start=repr(self.start(one)))) for one in self.given]
        output = self.model.output
        outputs = [
            (output.name, "output", changes, "The model's value", _real(output)),
            (BITS, "output", "discrete", self._about_bits(), "<Integer/>"),
        ]
        yield "<ModelVariables>"
        variables = [*inputs, *outputs]
        names = [*identifiers([name for name, *_ in variables[:-1]], [BITS]), BITS]
        for place, (name, (known, causality, variability, what, kind)) in enumerate(zip(names, variables, strict=True)):
            text = what if name == known else f"{known}. {what}"
            about = _attributes(name=name, valueReference=str(place), description=text, causality=causality, variability=variability)
            yield from (f"  <ScalarVariable{about}>", f"    {kind}", "  </ScalarVariable>")
        yield "</ModelVariables>"

    def _about_input(self, quantity: Quantity) -> str:
        if quantity not in self.model.inputs:
            return "Measured output, which the model goes on from; counts as long as there is no value"
        for limit in self.code.limits:
            if limit.inputs == {quantity.name}:
                return f"Trained from {min(limit.low):.6g} to {max(limit.high):.6g} {quantity.unit}"
        return "An input"

    def _about_bits(self) -> str:
        bits = [f"{1 << place} for {quantity.name}" for place, quantity in enumerate(self.model.inputs)]
        nothing = f", {1 << len(bits)} where there is no value yet or the run has diverged" * self.with_memory
        return f"0, or the sum of {', '.join(bits)} outside of its training range{nothing}"

    def _structure(self) -> Iterator[str]:
        count = len(self.given)
        unknowns = [f"<Unknown{_attributes(index=str(count + i), dependencies=' '.join(map(str, range(1, count + 1))))}/>" for i in (1, 2)]
        yield "<ModelStructure>"
        for part in ("Outputs", "InitialUnknowns"):
            yield from (f"  <{part}>", *(f"    {unknown}" for unknown in unknowns), f"  </{part}>")
        yield "</ModelStructure>"


def _attributes(**texts: str) -> str:
    """Attributes of an XML element, with a space before each."""
    return "".join(f" {name}={quoteattr(xml_text(text))}" for name, text in texts.items())


def _real(quantity: Quantity, **more: str) -> str:
    return f"<Real{_attributes(unit=quantity.unit, **more)}/>"


def _c_function(head: str, *body: str) -> list[str]:
    return [f"static {head}", "{", *(f"    {line}" for line in body), "}", ""]
