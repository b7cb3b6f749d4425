"""Derivatives of a model in C, and the input for a wanted output, as `modelling.inverse` finds it; for models without memory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from importlib.resources import files

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.foreign import c_comment
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.exporting.c_source import Source, source_of
from mapmore_cli.modelling.inverse import BISECTIONS, FLAT, NONE, ONE, REACHED, SAME, SEVERAL, SPLITS, STEEP, knots, parts_between
from mapmore_cli.modelling.program.model import with_slopes

STATUS = (NONE, ONE, SEVERAL, FLAT)
"""What the functions return, from 0."""

DIVIDED = 64
"""Parts of a scan that are divided further at most, so that its places have room on the stack; Python knows no such limit."""

COARSER = 1000.0
"""Times wider limits in single precision."""


@dataclass(frozen=True)
class InverseSource:
    """The second header and source of a model; `slopes` is the model with its derivatives."""

    slopes: Source

    @property
    def stem(self) -> str:
        """What the files are called."""
        return f"{self.slopes.name}_inverse"

    @cached_property
    def knots(self) -> dict[Quantity, Array]:
        """Places between which the model is smooth, along every input whose training range is known."""
        found = {}
        for quantity in self.slopes.model.inputs:
            try:
                found[quantity] = knots(self.slopes.model, quantity.name)
            except UsageError:
                continue
        return found

    def files(self) -> dict[str, str]:
        """Header and source by name."""
        return {f"{self.stem}.h": self._header(), f"{self.stem}.c": self._text()}

    @property
    def _differentiate(self) -> str:
        real, count = self.slopes.real, f"{self.slopes.prefix}_INPUTS"
        return f"int {self.slopes.name}_derivatives(const {real} in[{count}], {real} *out, {real} slopes[{count}])"

    def _invert(self, quantity: Quantity) -> str:
        real, count = self.slopes.real, f"{self.slopes.prefix}_INPUTS"
        return f"int {self.slopes.name}_invert_{self.slopes.names[quantity.name]}(const {real} in[{count}], {real} wanted, {real} *found)"

    def _header(self) -> str:
        name, prefix, output = self.slopes.name, self.slopes.prefix, self.slopes.model.output.name
        lines = [f"Derivatives of {name}, and its inputs for a wanted {output}.", ""]
        lines += [f"{name}_derivatives writes the {output} to out and its derivative for every input to slopes; it returns what"]
        lines += [f"{name}_eval returns. At a boundary the derivative is that of the piece that holds there."]
        if self.knots:
            lines += [
                "",
                f"{name}_invert_... writes the value of an input for the wanted {output}, at the other inputs, to found; NAN for none.",
                "Of several solutions within the training range it is the one that is nearest to what that input is in the inputs, or",
                "the lowest where that is NAN. A flat solution fills a range: its low end counts. It returns one of these:",
            ]
        lines = [*c_comment(*lines), f"#ifndef {prefix}_INVERSE_H", f"#define {prefix}_INVERSE_H", "", f'#include "{name}.h"', ""]
        if self.knots:
            lines += [f"#define {prefix}_{status.upper()} {number}" for number, status in enumerate(STATUS)] + [""]
        lines += [f"{self._differentiate};", *(f"{self._invert(quantity)};" for quantity in self.knots)]
        return "\n".join([*lines, "", "#endif", ""])

    def _text(self) -> str:
        source = self.slopes
        inputs = range(len(source.model.inputs))
        lines = source.evaluation(self._differentiate, ["*out", *(f"slopes[{i}]" for i in inputs)])
        if self.knots:
            lines += self._macros()
            lines.append(files(__package__).joinpath("sources", "inverse.c").read_text(encoding="utf-8"))
            lines += [line for quantity in self.knots for line in self._inverse(quantity)]
        return source.file(lines, self.stem)

    def _macros(self) -> list[str]:
        """Return what the functions of every inverse have to know of this one."""
        source, f = self.slopes, "f" * self.slopes.single
        coarser = COARSER if source.single else 1.0
        edges = max(2 * (len(places) - 1) * (parts_between(places) + 1) + 1 for places in self.knots.values())
        defined = {
            "INPUTS": f"{source.prefix}_INPUTS",
            "EVALUATE": f"{source.name}_eval",
            "DIFFERENTIATE": f"{source.name}_derivatives",
            **{status.upper(): f"{source.prefix}_{status.upper()}" for status in STATUS},
            "DIVIDED": f"{DIVIDED} /* parts that are divided further at most */",
            "SPLITS": str(SPLITS),
            "STEEP": source.dialect.number(STEEP),
            "PLACES": f"{edges + 2 * DIVIDED} /* ends of monotone parts at most: two arrays of them lie on the stack */",
            "SAME": source.dialect.number(SAME * coarser),
            "REACHED": source.dialect.number(REACHED * coarser),
            "BISECTIONS": str(BISECTIONS),
            "NEXT": f"nextafter{f}",
            "FABS": f"fabs{f}",
            "FMIN": f"fmin{f}",
            "FMAX": f"fmax{f}",
        }
        return [*(f"#define {name} {text}" for name, text in defined.items()), "", f"typedef {source.real} real;", ""]

    def _inverse(self, quantity: Quantity) -> list[str]:
        source, places = self.slopes, self.knots[quantity]
        numbers = ", ".join(source.dialect.number(place) for place in places.tolist())
        body = [
            f"static const real knots[] = {{{numbers}}};",
            f"const problem p = {{in, {source.place(quantity)}, wanted}};",
            f"return solved(&p, {len(places)}, knots, {parts_between(places)}, found);",
        ]
        return [self._invert(quantity), "{", *(f"    {line}" for line in body), "}", ""]


@dataclass(frozen=True)
class CSource:
    """The files of a model in C, by name, and what its functions begin with."""

    name: str
    files: dict[str, str]


def c_source(model: Model, single: bool = False) -> CSource:
    """Header, source and a small program to try the model with; in single precision if so wished.

    For a model without memory a second header and source have its derivatives and its inverse.

    Raises
    ------
    UsageError
        Where the model's name has nothing that C allows, or it has too many inputs.
    DataError
        Where a part of the model is no closed expression.
    """
    source = source_of(model, single)
    name = source.name
    files = {f"{name}.h": source.header(), f"{name}.c": source.source(), f"{name}_main.c": source.program()}
    inverse = {} if source.with_memory else InverseSource(replace(source, code=with_slopes(source.code))).files()
    return CSource(name, {**files, **inverse})
