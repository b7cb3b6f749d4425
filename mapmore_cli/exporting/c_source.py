"""The text of C files: declarations, the function that a model comes to, what it keeps, and a small program."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.foreign import c_comment
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity, Signal
from mapmore_cli.exporting.c_blocks import CBlocks, indented
from mapmore_cli.exporting.dialect import DOUBLE, SINGLE, Dialect, Expressions, identifier, names_of_inputs, renamed
from mapmore_cli.modelling.kinds import OUTSIDE_TOLERANCE
from mapmore_cli.modelling.program.model import program_of
from mapmore_cli.modelling.program.statements import Limit, Program
from mapmore_cli.modelling.program.values import INPUT

MOST_INPUTS = 14
"""Bits of the returned number, one for every input and one more: an `int` may have 16."""

SIGN = """\
static {real} sign_of({real} x)
{{
    return ({real})((x > 0) - (x < 0));
}}
"""

BEYOND = """\
/* Whether x lies beyond a range; what is within {tolerance} of it counts as inside. */
static int beyond({real} x, {real} low, {real} high)
{{
    const {real} size = fabs{f}(low) > fabs{f}(high) ? fabs{f}(low) : fabs{f}(high);
    const {real} margin = {tolerance} * (high - low > size ? high - low : size);
    return x < low - margin || x > high + margin;
}}
"""

BETWEEN = """\
/* The end of a range at a level, linear between n levels. */
static {real} end_at({real} level, int n, const {real} *levels, const {real} *ends)
{{
    int i = 0;
    if (level <= levels[0]) return ends[0];
    if (level >= levels[n - 1]) return ends[n - 1];
    while (level >= levels[i + 1]) i++;
    return (ends[i + 1] - ends[i]) / (levels[i + 1] - levels[i]) * (level - levels[i]) + ends[i];
}}
"""


def source_of(model: Model, single: bool = False) -> Source:
    """Return the model as the text of its files, in single precision or not.

    Raises
    ------
    UsageError
        Where the model's name has nothing that C allows, or it has too many inputs.
    DataError
        Where a part of the model is no closed expression.
    """
    if len(model.inputs) > MOST_INPUTS:
        raise UsageError(f"{model.name} has {len(model.inputs)} inputs; one bit each leaves room for {MOST_INPUTS}", "export its parts")
    return Source(model, program_of(model), identifier(model.name), single)


@dataclass(frozen=True)
class Source:
    """A model as the text of its files; `code` is the model itself, or with its derivatives."""

    model: Model
    code: Program
    name: str
    single: bool

    @property
    def real(self) -> str:
        """The type of numbers."""
        return "float" if self.single else "double"

    @property
    def dialect(self) -> Dialect:
        """How numbers and functions are written."""
        return SINGLE if self.single else DOUBLE

    @property
    def prefix(self) -> str:
        """How the names of macros begin."""
        return self.name.upper()

    @property
    def names(self) -> dict[str, str]:
        """What each input is called in macros and functions."""
        return names_of_inputs(self.model.inputs)

    @property
    def with_memory(self) -> bool:
        """Whether it goes on from sample to sample."""
        return self.code.step is not None

    @property
    def call(self) -> str:
        """Head of the function that computes the output."""
        given = f"const {self.real} in[{self.prefix}_INPUTS], {self.real} *out"
        return f"int {self.name}_step({self.name}_state *s, {given})" if self.with_memory else f"int {self.name}_eval({given})"

    def header(self) -> str:
        """Return the declarations, with names and units."""
        lines = [*c_comment(*self._about()), f"#ifndef {self.prefix}_H", f"#define {self.prefix}_H", ""]
        lines += [f"#define {self.prefix}_INPUTS {len(self.model.inputs)}"]
        lines += [f"#define {self.place(q)} {i} {c_comment(_unit(q))[0]}" for i, q in enumerate(self.model.inputs)]
        if self.with_memory:
            lines += [f"#define {self.prefix}_NO_VALUE {1 << len(self.model.inputs)} /* bit: no history yet, or the run has diverged */"]
            lines += [f"#define {self.prefix}_SECONDS {self.code.step!r} /* between samples */", "", *self._state(), ""]
            lines += [f"void {self.name}_reset({self.name}_state *s);"]
        lines += ["", f"{self.call};"]
        lines += [f"void {self.name}_measured({self.name}_state *s, {self.real} value);"] * bool(self.code.kept.fed_back)
        return "\n".join([*lines, "", "#endif", ""])

    def _about(self) -> Iterator[str]:
        model = self.model
        yield f"{model.name}: {_unit(model.output)} from {', '.join(map(_unit, model.inputs)) or 'nothing'}."
        yield ""
        if not self.with_memory:
            yield f"{self.name}_eval writes the {model.output.name} to out."
        else:
            yield f"{self.name}_reset once, then {self.name}_step every {self.code.step!r} s: it writes the {model.output.name} to out."
        yield "It returns 0, or bit i for every input i outside of its training range; there the value is extrapolated."
        yield "Where an input is not finite, its bit is set and out is NAN" + (", and memory starts anew." if self.with_memory else ".")
        if self.with_memory:
            yield f"Before there is history, and once a run has diverged, bit {self.prefix}_NO_VALUE is set and out is NAN."
        for output in self.code.kept.fed_back:
            yield f"The model goes on from its own {output}. As long as {self.prefix}_NO_VALUE is returned after a reset, tell it the"
            yield f"measured {output} of the same sample by {self.name}_measured; later this may be done to correct it."
        for signal in model.signals:
            yield _of_signal(signal)
        yield from renamed(self.names)
        yield "No allocation, no global state; needs math.h alone."

    def _state(self) -> list[str]:
        numbers = [f"{self.real} {name};" for name in self.code.kept.numbers]
        queues = [line for name, size in self.code.kept.queues.items() for line in (f"{self.real} {name}[{size}];", f"int {name}_at;")]
        return ["typedef struct {", *indented([*numbers, *queues]), f"}} {self.name}_state;"]

    def source(self) -> str:
        """Return the functions."""
        reset = self._reset() if self.with_memory else []
        return self.file([*reset, *self.evaluation(self.call, ("*out",))])

    def evaluation(self, head: str, results: Sequence[str]) -> list[str]:
        """Return a function that writes what the model comes to where `results` are, after those that it needs."""
        blocks = CBlocks(self.code, self.dialect, self.real)
        functions = [line for function in self.code.functions for line in blocks.function(function)]
        return [*functions, head, "{", *indented(self._body(blocks, results)), "}", ""]

    def file(self, functions: Sequence[str], header: str = "") -> str:
        """Return the text of a source file, with the helpers that its functions need."""
        fill = {"real": self.real, "f": "f" * self.single, "tolerance": self.dialect.number(OUTSIDE_TOLERANCE)}
        body = "\n".join(functions)
        helpers = [(SIGN, "sign_of("), (BEYOND, "beyond("), (BETWEEN, "end_at(")]
        return "\n".join(
            [f'#include "{header or self.name}.h"', "", "#include <math.h>", ""]
            + [text.format(**fill) for text, used in helpers if used in body]
            + [body]
        )

    def _body(self, blocks: CBlocks, results: Sequence[str]) -> list[str]:
        place = {quantity.name: self.place(quantity) for quantity in self.model.inputs}
        lines = [f"const {self.real} {INPUT}{name} = in[{place[name]}];" for name in place]
        lines.append("int bits = 0;")
        lines += [f"if (!isfinite({INPUT}{name})) bits |= 1 << {place[name]};" for name in place]
        given_up = [f"{self.name}_reset(s);"] if self.with_memory else []
        no_value = f" | {self.prefix}_NO_VALUE" if self.with_memory else ""
        nothing = [f"{result} = NAN;" for result in results]
        lines += ["if (bits) {", *indented([*given_up, *nothing, f"return bits{no_value};"]), "}"]
        statements, expressions = blocks.body()
        values = [f"{place} = {expressions.text(value)};" for place, value in zip(results, self.code.body.results, strict=True)]
        checks = [
            line
            for number, limit in enumerate(self.code.limits)
            for line in self._check(number, limit, expressions, [place[name] for name in place if name in limit.inputs])
        ]
        lost = [f"if (!isfinite(*out)) bits |= {self.prefix}_NO_VALUE;"] if self.with_memory else []
        return [*lines, *statements, *checks, *values, *lost, "return bits;"]

    def _check(self, number: int, limit: Limit, expressions: Expressions, places: Sequence[str]) -> Iterator[str]:
        """Set the bits of the inputs that are beyond a range."""
        bits = " | ".join(f"1 << {place}" for place in places)
        value = expressions.text(limit.value)
        if limit.at is None or len(limit.levels) == 1:
            ends = [self._number(float(end)) for end in (limit.low[0], limit.high[0])]
        else:
            tables = {"levels": limit.levels, "low": limit.low, "high": limit.high}
            for name, values in tables.items():
                yield f"static const {self.real} {name}{number}[] = {{{self._numbers(values)}}};"
            at, count = expressions.text(limit.at), len(limit.levels)
            ends = [f"end_at({at}, {count}, levels{number}, {name}{number})" for name in ("low", "high")]
        yield f"if (beyond({value}, {', '.join(ends)})) bits |= {bits};"

    def _reset(self) -> list[str]:
        numbers = [f"s->{name} = {self._number(value)};" for name, value in self.code.kept.numbers.items()]
        queues = [
            line
            for name, size in self.code.kept.queues.items()
            for line in (f"for (int i = 0; i < {size}; i++) s->{name}[i] = 0;", f"s->{name}_at = 0;")
        ]
        lines = [f"void {self.name}_reset({self.name}_state *s)", "{", *indented([*numbers, *queues]), "}", ""]
        for queues in self.code.kept.fed_back.values():
            last = [f"s->{queue}[{self._last(queue)}] = value;" for queue in queues]
            lines += [f"void {self.name}_measured({self.name}_state *s, {self.real} value)", "{", *indented(last), "}", ""]
        return lines

    def _last(self, queue: str) -> str:
        """Return the place of what came into a queue last."""
        size = self.code.kept.queues[queue]
        return f"(s->{queue}_at + {size - 1}) % {size}"

    def program(self) -> str:
        """Return a program that reads a sample a line, and prints the output and the bits of each."""
        measured = bool(self.code.kept.fed_back)
        read = f'scanf("%{"f" if self.single else "lf"}", &in[i]) == 1'
        state = [f"{self.name}_state s;"] if self.with_memory else []
        start = [f"{self.name}_reset(&s);"] if self.with_memory else []
        call = f"{self.name}_step(&s, in, &out)" if self.with_memory else f"{self.name}_eval(in, &out)"
        given = f"{self.prefix}_INPUTS{' + 1' * measured}"
        tell = [f"if (bits & {self.prefix}_NO_VALUE) {self.name}_measured(&s, in[{self.prefix}_INPUTS]);"] if measured else []
        columns = " ".join([*(quantity.name for quantity in self.model.inputs), *(f"{name}_measured" for name in self.code.kept.fed_back)])
        body = [
            f"{self.real} in[{given}], out;",
            *state,
            *start,
            "for (;;) {",
            *indented(
                [
                    "int bits;",
                    f"for (int i = 0; i < {given}; i++) {{",
                    *indented([f"if (!({read})) return 0;"]),
                    "}",
                    f"bits = {call};",
                    *tell,
                    'printf("%.17g %d\\n", (double)out, bits);',
                ]
            ),
            "}",
        ]
        head = c_comment(f"Reads {columns} from each line of stdin; prints {self.model.output.name} and the bits of inputs out of range.")
        return "\n".join(
            [*head, f'#include "{self.name}.h"', "", "#include <stdio.h>", "", "int main(void)", "{", *indented(body), "}", ""]
        )

    def place(self, quantity: Quantity) -> str:
        """Return the macro for the place of an input."""
        return f"{self.prefix}_IN_{self.names[quantity.name].upper()}"

    def _number(self, value: float) -> str:
        return self.dialect.number(value)

    def _numbers(self, values: Array) -> str:
        return ", ".join(self._number(value) for value in values.tolist())


def _unit(quantity: Quantity) -> str:
    return f"{quantity.name} [{quantity.unit}]"


def _of_signal(signal: Signal) -> str:
    if signal.kind == "direction":
        return (
            f"{signal.name} is an input: +1 while {signal.of} is above {signal.dead_band!r}, -1 while it is below -{signal.dead_band!r}, "
            "the last one in between; +1 at the start."
        )
    return (
        f"{signal.name} is an input: the model was trained on the derivative of {signal.of} over a centred window of {signal.window!r} s, "
        "which looks ahead; on a controller give the derivative over the last samples."
    )
