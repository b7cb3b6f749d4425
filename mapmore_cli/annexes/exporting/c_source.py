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

from mapmore_cli.annexes.exporting.dialect import (
    DOUBLE,
    SINGLE,
    Code,
    Dialect,
    Expressions,
    Statements,
    Wanted,
    code,
    identifier,
    lines_of_code,
    names_of_inputs,
    renamed,
    rendered,
    word,
)
from mapmore_cli.annexes.exporting.verifying import (
    CLOSE,
    CLOSE_SINGLE,
    CompilerMissing,
    verify_program,
)
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.foreign import c_comment
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
from mapmore_cli.modelling.program.statements import Choose, Function, Limit, Program
from mapmore_cli.modelling.program.writing import names_used_in

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
    return CSource(model, program_of(model), identifier(model.name), single)


@dataclass(frozen=True)
class CSource:
    """A model as the text of its files; `code` is the model itself, or with its derivatives."""

    model: Model
    code: Program
    name: Code
    single: bool

    @cached_property
    def files(self) -> dict[str, str]:
        """Header, source and a small program to try the model with, by name; without memory also
        its derivatives and its inverse.
        """
        name = self.name
        files = {
            f"{name}.h": self.header(),
            f"{name}.c": self.source(),
            f"{name}_main.c": self.program(),
        }
        return files if self.with_memory else files | self.inverse()

    @property
    def with_memory(self) -> bool:
        """Whether it goes on from sample to sample."""
        return self.code.step is not None

    @property
    def dialect(self) -> Dialect:
        """How numbers and functions are written."""
        return SINGLE if self.single else DOUBLE

    @property
    def real(self) -> Code:
        """The type of numbers."""
        return word("float" if self.single else "double")

    @property
    def prefix(self) -> Code:
        """How the names of macros begin."""
        return word(self.name.upper())

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
        words: dict[str, object] = {
            name: getattr(self, name)
            for name in ("model", "name", "prefix", "places", "real", "call")
        }
        own = {"step": self.code.step, "kept": self.code.kept, "number": self.dialect.number}
        return {
            **words,
            **own,
            "memory": self.with_memory,
            "single": self.single,
            "f": Code("f" * self.single),
        }

    @property
    def call(self) -> Code:
        """Head of the function that computes the output."""
        if self.with_memory:
            return self._head("step", code("{} *out", self.real), code("{}_state *s, ", self.name))
        return self._head("eval", code("{} *out", self.real))

    def _head(self, function: str, results: Code, state: Code = Code()) -> Code:  # noqa: B008 - nothing changes it
        return code(
            "int {}_{}({}const {} in[{}_INPUTS], {})",
            self.name,
            function,
            state,
            self.real,
            self.prefix,
            results,
        )

    def header(self) -> str:
        """Return the declarations, with names and units."""
        return rendered(
            "model.h", **self.words, renamed=renamed(names_of_inputs(self.model.inputs))
        )

    def source(self) -> str:
        """Return the functions."""
        return self._file(self.name, self.call, [code("*out")], reset=self.with_memory)

    def program(self) -> str:
        """Return a program that reads a sample a line, and prints the output and the bits of
        each.
        """
        measured = [f"{name}_measured" for name in self.code.kept.fed_back]
        columns = " ".join([*(quantity.name for quantity in self.model.inputs), *measured])
        given = code("{}_INPUTS + 1" if measured else "{}_INPUTS", self.prefix)
        return rendered("main.c", **self.words, columns=columns, given=given)

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
        return rendered(
            "model.c",
            **words,
            body=rendered("body.c", **words),
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
            coarser = COARSER if self.single else 1.0
            words |= {"STEEP": STEEP, "SAME": SAME * coarser, "REACHED": REACHED * coarser}
        name = code("{}_inverse", self.name)
        header = rendered("inverse.h", **self.words, **words, head=head)
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


@dataclass
class CStatements(Statements):
    """Writes statements in C; `real` is the type of numbers."""

    real: str = "double"

    def function(self, function: Function) -> list[str]:
        """Return a function that no other file sees; several results are written where the last
        argument points.
        """
        several = len(function.body.results) > 1
        parameters = [f"{self.real} {name}" for name in function.parameters] + [
            f"{self.real} *results"
        ] * several
        lines, results = self.block(function.body, self.expressions())
        used = names_used_in(function.body)
        ignored = [f"(void){name};" for name in function.parameters if name not in used]
        ends = (
            [f"results[{i}] = {text};" for i, text in enumerate(results)]
            if several
            else [f"return {results[0]};"]
        )
        head = f"static {'void' if several else self.real} {function.name}({', '.join(parameters)})"
        note = c_comment(function.note) if function.note else []
        return [*note, head, "{", *indented([*ignored, *lines, *ends]), "}", ""]

    def _used(self, names: Sequence[str], function: str, arguments: Sequence[str]) -> list[str]:
        if len(names) == 1:
            return [self.dialect.constant(names[0], f"{function}({', '.join(arguments)})")]
        results = f"{names[0]}_all"
        self.places.update({name: f"{results}[{i}]" for i, name in enumerate(names)})
        return [
            f"{self.real} {results}[{len(names)}];",
            f"{function}({', '.join([*arguments, results])});",
        ]

    def _chosen(self, choice: Choose, expressions: Expressions) -> None:
        conditions = [expressions.condition(condition) for condition, _ in choice.cases]
        blocks = [block for _, block in choice.cases] + [choice.otherwise]
        if len(choice.names) == 1 and not any(block.statements for block in blocks):
            inner = [expressions.inner() for _ in blocks]
            values = [own.text(block.results[0]) for own, block in zip(inner, blocks, strict=True)]
            if not any(own.lines for own in inner):
                text = (
                    "".join(
                        f"{condition} ? {value} : "
                        for condition, value in zip(conditions, values, strict=False)
                    )
                    + values[-1]
                )
                expressions.lines.append(self.dialect.constant(choice.names[0], text))
                return
        lines = [f"{self.real} {name};" for name in choice.names]
        openings = [f"if ({condition}) {{" for condition in conditions] + ["{"]
        for i, (opening, block) in enumerate(zip(openings, blocks, strict=True)):
            lines.append(f"}} else {opening}" if i else opening)
            own, results = self.block(block, expressions.inner())
            lines.extend(
                indented(
                    [
                        *own,
                        *(
                            f"{name} = {text};"
                            for name, text in zip(choice.names, results, strict=True)
                        ),
                    ]
                )
            )
        expressions.lines.extend([*lines, "}"])

    def _recalled(self, queue: str, steps: int) -> str:
        size = self.program.kept.queues[queue]
        return f"s->{queue}[(s->{queue}_at + {size - steps}) % {size}]"

    def _kept(self, place: str, text: str) -> str:
        return f"{place} = {text};"

    def _queued(self, queue: str, text: str, size: int) -> list[str]:
        return [f"{queue}[{queue}_at] = {text};", f"{queue}_at = ({queue}_at + 1) % {size};"]


def indented(lines: Sequence[str]) -> list[str]:
    """Lines one step to the right."""
    return [f"    {line}" if line else line for line in lines]


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
    text = rendered("mujoco.c", **source.words, pressure=inputs["pressure"])
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
        **{f"{source.name}_simulink.{end}": rendered(f"simulink.{end}", **words) for end in "hc"},
    }
