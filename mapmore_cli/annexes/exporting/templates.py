"""Code as text, names in it, and the templates of files.

A template takes `Code` and numbers as they stand. It writes every other text as a literal of its
language.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import PurePath
from xml.sax.saxutils import quoteattr

from jinja2 import Environment, PackageLoader, StrictUndefined

from mapmore_cli.annexes.exporting.words import FILES, TAKEN, identifiers, words_of
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.foreign import PLAIN, plain, tex_text, xml_text
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.expressions.functions import FUNCTIONS, HELPER
from mapmore_cli.modelling.expressions.states import IDENTIFIER
from mapmore_cli.modelling.programs import program_of

Warn = Callable[[str], None]


@dataclass(frozen=True)
class Wanted:
    """How a model is exported: numbers of `single` precision, the points of a `grid`, compared with
    `predict` where it says `verify`; `warn` is told what could not be done.
    """

    single: bool
    grid: str | None
    verify: bool
    warn: Warn


class Code(str):
    """A text that our own printers made, of words that are none of a stranger's."""

    __slots__ = ()


def word(text: str) -> Code:
    """Return a text that is an identifier; raises DataError where it is none."""
    if not IDENTIFIER.fullmatch(text):
        problem = f"the model calls something {plain(text)[:60]!r}, which cannot be a name in code"
        raise DataError(problem, "make the model anew with names of letters, digits and _")
    return Code(text)


def code(form: str, *parts: Code | str | float) -> Code:
    """Return a form of ours with its braces filled: with code and numbers, and with texts that are
    identifiers.
    """
    return Code(
        form.format(
            *(
                word(part) if isinstance(part, str) and not isinstance(part, Code) else part
                for part in parts
            )
        )
    )


PYTHON = (
    *("np", "float", "s", "finite", "_beyond", "state", "State", "step", "evaluate"),
    *map(HELPER.format, FUNCTIONS),
)
"""Names in functions of a module that its inputs must not hide."""

OWN = (
    *PYTHON,
    *("outside_range", "derivatives", "reset", "eval", "valid", "measured", "math", "in", "out"),
    *("outside", "x", "n", "j", "k", "y", "given", "largest", "shape", "value", "one_sample"),
    *("beyond", "interpolated", "begun", "places", "values", "validity", "fileName", "cellfun"),
    *("numel", "size", "ones", "isempty", "verify_model", "power_of"),
)
"""Names in the templates of all languages, which no output and no model has."""

_FUNCTION = re.compile("(curve|segment)_[0-9]+|slope_(inside|at_end)")
"""How functions of programs are called."""


def identifier(name: str) -> Code:
    """Return the name of a model's functions and files, with `_` for what C does not allow; before
    a digit, and before a word of a language, its library or the templates, goes `model_`.

    The same before `x` and `x_...`: `x_reset` is an input in C. Raises UsageError where there is no
    letter and no digit in it.
    """
    # with what is added, compilers tell 63 letters apart
    letters = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")[:40].rstrip("_")
    if not letters:
        raise UsageError(
            f"the model is called `{name}`, which has no letter that C allows in a name",
            "give the study another name",
        )
    first, reserved = letters.lower().partition("_")[0], FILES.union(map(str.lower, OWN))
    hidden = letters.lower() in reserved or _FUNCTION.fullmatch(letters.lower())
    return word(f"model_{letters}" if first[0].isdigit() or first == "x" or hidden else letters)


def names_of_inputs(inputs: Sequence[Quantity], functions: Sequence[str] = ()) -> dict[str, str]:
    """Return what each input is called in code beside some `functions`, by its name."""
    names = [quantity.name for quantity in inputs]
    reserved = [*PYTHON, *functions, *(f"x_{name}" for name in names)]
    return dict(zip(names, identifiers(names, reserved), strict=True))


def names_in_matlab(inputs: Sequence[Quantity], functions: Sequence[str]) -> dict[str, str]:
    """Return what each input is called in MATLAB beside some `functions`: no name begins with
    `_`.
    """
    used = [*words_of("MATLAB", "Octave"), *functions]
    return {
        name: in_code if in_code[0].isalpha() else f"u{in_code}"
        for name, in_code in names_of_inputs(inputs, used).items()
    }


def name_of_output(model: Model, names: Iterable[str] | None = None) -> Code:
    """Return what the output is called in code beside the `names` of the inputs, which are those of
    `names_of_inputs` by default: a function or a variable.
    """
    input_names = [*(names_of_inputs(model.inputs).values() if names is None else names)]
    functions = [function.name for function in program_of(model).functions]
    reserved = [*TAKEN, *OWN, *functions, identifier(model.name), *input_names]
    reserved += [f"invert_{name}" for name in input_names]
    return word(identifiers([model.output.name], reserved)[0].lstrip("_") or "output")


def notes_of(model: Model, names: Mapping[str, str]) -> list[str]:
    """Return a line for each input that is called otherwise here, and for the shape that the model
    keeps.
    """
    renamed = [
        f"The input {name} is called {other} here."
        for name, other in names.items()
        if name != other
    ]
    kept = [] if model.shape is None or not model.shape.kept else [model.shape.promise]
    name = f"{model.output.name} at rest" if model.memories else model.output.name
    return [*renamed, *(f"The {name} is {promise}." for promise in kept)]


def c_string(text: str) -> str:
    """Return the text as a string in C; other bytes than those of `PLAIN` are octal escapes, so
    that there are no trigraphs.
    """
    return (
        '"'
        + "".join(
            chr(byte) if chr(byte) in PLAIN else f"\\{byte:03o}"
            for byte in text.encode(errors="surrogatepass")
        )
        + '"'
    )


LITERALS: Mapping[str, Callable[[str], str]] = {
    **dict.fromkeys("ch", c_string),
    "sh": shlex.quote,
    "m": lambda text: "'" + plain(text).replace("'", "''") + "'",
    "mjs": lambda text: json.dumps(text).replace("<", "\\u003c"),
    "mo": lambda text: json.dumps(plain(text)),
    "py": repr,
    "tex": tex_text,
    "xml": lambda text: quoteattr(xml_text(text)),
}
"""How a text is written in a language, by the ending of its files."""


@cache
def templates(language: str) -> Environment:
    """Return the templates of `sources/`, for a language."""

    def written(value: object) -> object:
        if isinstance(value, Code | int | float):
            return value
        if isinstance(value, str):
            return LITERALS[language](str(value))
        raise TypeError(f"not a text, and no number: {value!r}")

    def noted(text: str) -> Code:
        # on a page, `</script>` ends a script even within a comment
        return Code(note(text).replace("<", "{3C}")) if language == "mjs" else note(text)

    loader = PackageLoader(__package__, "sources")
    environment = Environment(
        loader=loader,
        undefined=StrictUndefined,
        finalize=written,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.keep_trailing_newline = True
    environment.filters |= {
        "word": word,
        "note": noted,
        "listed": lambda parts: Code(", ".join(str(written(part)) for part in parts)),
    }
    environment.filters["unit"] = lambda quantity: noted(f"{quantity.name} [{quantity.unit}]")
    return environment


def note(text: str) -> Code:
    """Return a text for the inside of a comment, which nothing in it can end; it belongs nowhere
    else.
    """
    return Code(plain(text))


NOTICE = (
    "This file contains code of mapmore. Copyright (c) 2026 The mapmore authors. "
    "SPDX-License-Identifier: MIT"
)
COMMENTS = {
    **dict.fromkeys((".c", ".h"), "/* {} */"),
    **{".py": "# {}", ".m": "% {}", ".mjs": "// {}", ".mo": "// {}"},
}
"""How a comment is written in files of code, by the ending of their names."""


def with_notice(name: str, text: str) -> str:
    """Return the text of a file with the notice that the licence of our templates asks for, if it
    is code. It stands at the end in MATLAB, where the first comment is the help of the function.
    """
    comment = COMMENTS.get(PurePath(name).suffix)
    if comment is None:
        return text
    line = comment.format(NOTICE)
    return f"{text}\n{line}\n" if name.endswith(".m") else f"{line}\n{text}"


def rendered_template(template: str, **words: object) -> Code:
    """Return a file of `sources/` with the words put in."""
    return Code(
        templates(template.rpartition(".")[2]).get_template(f"{template}.jinja").render(words)
    )


def source(name: str) -> str:
    """Return a file of `sources/` as it is."""
    return files(__package__).joinpath("sources", name).read_text(encoding="utf-8")
