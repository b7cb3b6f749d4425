"""A model in C: header, source and a small program; without memory its derivatives too, and the
input for a wanted output.

The inverse is that of `modelling.inverse`, in the same steps. MuJoCo and Simulink call the C by
wrappers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from mapmore_cli.annexes.exporting.c_statements import CStatements
from mapmore_cli.annexes.exporting.dialect import DOUBLE, SINGLE, Dialect, Expressions
from mapmore_cli.annexes.exporting.templates import (
    Code,
    Wanted,
    code,
    identifier,
    lines_of_code,
    names_of_inputs,
    notes_of,
    rendered_template,
    word,
)
from mapmore_cli.annexes.exporting.verifying import (
    CLOSE,
    CLOSE_SINGLE,
    CompilerMissing,
    verify_program,
)
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.inverse import (
    BISECTIONS,
    FLAT,
    NONE,
    ONE,
    REACHED,
    SAME,
    SEVERAL,
    SPLITS,
    STEEP,
    knots,
    parts_between,
)
from mapmore_cli.modelling.kinds import OUTSIDE_TOLERANCE, runs_over_time
from mapmore_cli.modelling.program.model import program_of, with_slopes
from mapmore_cli.modelling.program.statements import Limit, Program

MOST_INPUTS = 14
"""Bits of the returned number, one for every input and one more: an `int` may have 16."""

STATUS = (NONE, ONE, SEVERAL, FLAT)
"""What the inverse functions return, from 0."""

DIVIDED = 64
"""Parts of a scan that are divided further at most, so that its places have room on the stack;
Python knows no such limit.
"""

COARSER = 1000.0
"""Times wider limits of the inverse in single precision."""


def c_files(model: Model, wanted: Wanted) -> dict[str, str]:
    """Return the C of a model, compared with `predict` where there is a compiler."""
    source = c_source(model, wanted.single)
    if wanted.verify:
        compiled = [f"{source.name}.c", f"{source.name}_main.c"]
        try:
            close = CLOSE_SINGLE if wanted.single else CLOSE
            verify_program(model, source.files, compiled, close)
        except CompilerMissing as reason:
            wanted.warn(f"{reason}: the source was not compared with `mapmore predict`")
    return source.files


def c_source(model: Model, single: bool = False) -> CSource:
    """Return a model in C, in single precision if so wished.

    Raises UsageError where the model's name has nothing that C allows, or it has too many inputs;
    DataError where a part of it is no closed expression.
    """
    if len(model.inputs) > MOST_INPUTS:
        raise UsageError(
            f"{model.name} has {len(model.inputs)} inputs; one bit each leaves room for "
            f"{MOST_INPUTS}",
            "export its parts",
        )
    name, real = identifier(model.name), word("float" if single else "double")
    dialect = SINGLE if single else DOUBLE
    return CSource(model, program_of(model), name, word(name.upper()), real, dialect)


@dataclass(frozen=True)
class CSource:
    """A model as the text of its files.

    - `code`: the model itself, or with its derivatives.
    - `name`, `prefix`: of its functions, and how the names of macros begin.
    - `real`, `dialect`: the type of numbers, and how numbers and functions are written.
    """

    model: Model
    code: Program
    name: Code
    prefix: Code
    real: Code
    dialect: Dialect

    @cached_property
    def files(self) -> dict[str, str]:
        """Header, source and a small program to try the model with, by name; of one output without
        memory also its derivatives and its inverse.
        """
        name = self.name
        files = {
            f"{name}.h": self.header(),
            f"{name}.c": self.source(),
            f"{name}_main.c": self.program(),
        }
        alone = not self.with_memory and len(self.model.each) == 1
        return files | self.inverse() if alone else files

    @property
    def with_memory(self) -> bool:
        """Whether it goes on from sample to sample."""
        return self.code.step is not None

    @cached_property
    def places(self) -> dict[str, Code]:
        """The macro for the place of every input, by its name."""
        return {
            name: code("{}_IN_{}", self.prefix, own.upper())
            for name, own in names_of_inputs(self.model.inputs).items()
        }

    @property
    def words(self) -> dict[str, object]:
        """What templates know of the model."""
        names = ("model", "name", "prefix", "places", "real", "call")
        single = self.dialect is SINGLE
        return {name: getattr(self, name) for name in names} | {
            "step": self.code.step,
            "kept": self.code.kept,
            "number": self.dialect.number,
            "memory": self.with_memory,
            "single": single,
            "f": Code("f" * single),
            "outputs": self.outputs,
        }

    @property
    def outputs(self) -> dict[str, Code]:
        """The macro for the place of every output, where there are several."""
        if len(self.model.each) == 1:
            return {}
        names = names_of_inputs(self.model.outputs)
        return {name: code("{}_OUT_{}", self.prefix, own.upper()) for name, own in names.items()}

    @property
    def call(self) -> Code:
        """Head of the function that computes the outputs."""
        out = code("{} *out", self.real)
        if self.outputs:
            out = code("{} out[{}_OUTPUTS]", self.real, self.prefix)
        if self.with_memory:
            return self._head("step", out, code("{}_state *s, ", self.name))
        return self._head("eval", out)

    def _head(self, function: str, results: Code, state: str = "") -> Code:
        return code(
            "int {}_{}({}const {} in[{}_INPUTS], {})",
            self.name,
            function,
            Code(state),
            self.real,
            self.prefix,
            results,
        )

    def header(self) -> str:
        """Return the declarations, with names and units."""
        return rendered_template(
            "model.h", **self.words, notes=notes_of(self.model, names_of_inputs(self.model.inputs))
        )

    def source(self) -> str:
        """Return the functions."""
        results = [code("out[{}]", place) for place in self.outputs.values()] or [code("*out")]
        return self._file(self.name, self.call, results, reset=self.with_memory)

    def program(self) -> str:
        """Return a program that reads a sample a line, and prints the output and the bits of
        each.
        """
        measured = [f"{name}_measured" for name in self.code.kept.fed_back]
        columns = " ".join([*(quantity.name for quantity in self.model.inputs), *measured])
        given = code("{}_INPUTS + 1" if measured else "{}_INPUTS", self.prefix)
        return rendered_template("main.c", **self.words, columns=columns, given=given)

    def _file(self, header: Code, head: Code, results: Sequence[Code], **words: object) -> str:
        """Return a source file whose function `head` writes what the model comes to where `results`
        are.
        """
        statements = CStatements(self.code, self.dialect, "s->", real=self.real)
        functions = [
            line for function in self.code.functions for line in statements.function(function)
        ]
        expressions = statements.expressions()
        lines, values = statements.block(self.code.body, expressions)
        checks = [
            line
            for number, limit in enumerate(self.code.limits)
            for line in self._check(number, limit, expressions)
        ]
        lines = [
            *lines,
            *checks,
            *(f"{place} = {value};" for place, value in zip(results, values, strict=True)),
        ]
        words = {
            "reset": False,
            "inverses": (),
            **self.words,
            **words,
            "header": f"{header}.h",
            "head": head,
            "results": results,
        }
        words |= {"functions": lines_of_code(functions), "statements": lines_of_code(lines)}
        return rendered_template(
            "model.c",
            **words,
            body=rendered_template("body.c", **words),
            tolerance=self.dialect.number(OUTSIDE_TOLERANCE),
        )

    def _check(self, number: int, limit: Limit, expressions: Expressions) -> Iterator[str]:
        """Set the bits of the inputs that are beyond a range."""
        bits = " | ".join(
            f"1 << {place}" for name, place in self.places.items() if name in limit.inputs
        )
        value = expressions.text(limit.value)
        if limit.at is None or len(limit.levels) == 1:
            ends: list[str] = [self.dialect.number(end[0]) for end in (limit.low, limit.high)]
        else:
            for name, values in (
                ("levels", limit.levels),
                ("low", limit.low),
                ("high", limit.high),
            ):
                numbers = ", ".join(map(self.dialect.number, values.tolist()))
                yield f"static const {self.real} {name}{number}[] = {{{numbers}}};"
            at, count = expressions.text(limit.at), len(limit.levels)
            ends = [
                f"end_at({at}, {count}, levels{number}, {name}{number})" for name in ("low", "high")
            ]
        yield f"if (beyond({value}, {', '.join(ends)})) bits |= {bits};"

    def inverse(self) -> dict[str, str]:
        """Return the second header and source of a model without memory, by name: derivatives, and
        inverses where ranges are known.
        """
        slopes = [code("slopes[{}]", i) for i in range(len(self.model.inputs))]
        head = self._head(
            "derivatives", code("{0} *out, {0} slopes[{1}_INPUTS]", self.real, self.prefix)
        )
        inverses = list(self._inverses())
        words: dict[str, object] = {"inverses": inverses, "status": STATUS}
        if inverses:
            words["ends"] = max(inverse["ends"] for inverse in inverses) + 2 * DIVIDED
            words |= {"DIVIDED": DIVIDED, "SPLITS": SPLITS, "BISECTIONS": BISECTIONS}
            coarser = COARSER if self.dialect is SINGLE else 1.0
            words |= {"STEEP": STEEP, "SAME": SAME * coarser, "REACHED": REACHED * coarser}
        name = code("{}_inverse", self.name)
        header = rendered_template("inverse.h", **self.words, **words, head=head)
        source = replace(self, code=with_slopes(self.code))
        return {
            f"{name}.h": header,
            f"{name}.c": source._file(name, head, [code("*out"), *slopes], **words),
        }

    def _inverses(self) -> Iterator[dict[str, Any]]:
        """Yield the function that solves for an input, for every one whose training range is
        known.
        """
        for name, own in names_of_inputs(self.model.inputs).items():
            try:
                places = knots(self.model, name)
            except UsageError:
                continue
            numbers, parts = (
                [self.dialect.number(place) for place in places.tolist()],
                parts_between(places),
            )
            head = self._head(f"invert_{own}", code("{0} wanted, {0} *found", self.real))
            ends = 2 * (len(places) - 1) * (parts + 1) + 1
            yield {
                "head": head,
                "place": self.places[name],
                "knots": numbers,
                "parts": parts,
                "ends": ends,
            }


# Around the C of a model: an actuator of MuJoCo, and a function for Simulink's C Caller
# -------------------------------------------------


def mujoco_files(model: Model, _wanted: Wanted) -> dict[str, str]:
    """Return the C of a model of pressure and strain, and a callback that MuJoCo asks for the force
    of an actuator.

    Raises UsageError for a model with other inputs, or with memory.
    """
    inputs = {quantity.name: quantity.unit for quantity in model.inputs}
    if (
        runs_over_time(model)
        or set(inputs) != {"pressure", "strain"}
        or model.output.name != "force"
    ):
        raise UsageError(
            "an actuator of MuJoCo is a force by pressure and strain",
            "export this model as py, and call it in a callback",
        )
    if (inputs["strain"], model.output.unit) != ("1", "N"):
        raise UsageError(
            "MuJoCo counts in m and N", "run the study with `units: {strain: 1, force: N}`"
        )
    source = c_source(model)
    text = rendered_template("mujoco.c", **source.words, pressure=inputs["pressure"])
    return {**source.files, f"{source.name}_mujoco.c": text}


def simulink_files(model: Model, _wanted: Wanted) -> dict[str, str]:
    """Return the C of a model, and a function of single numbers that a C Caller block calls.

    Raises UsageError for a model with memory: a C Caller block keeps no state.
    """
    if runs_over_time(model):
        raise UsageError(
            "a C Caller block keeps no state, and this model has memory",
            "export it as fmu, which Simulink imports",
        )
    source = c_source(model)
    names = names_of_inputs(model.inputs, [source.name])
    words = source.words | {"output": identifier(model.output.name), "names": names.values()}
    words["parameters"] = [code("double {}", name) for name in names.values()]
    return {
        **source.files,
        **{
            f"{source.name}_simulink.{end}": rendered_template(f"simulink.{end}", **words)
            for end in "hc"
        },
    }
