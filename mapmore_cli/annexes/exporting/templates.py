"""Represent code as text, choose names in it, and fill templates of files.

A template inserts `Code` and numbers unchanged. It writes every other text as a literal of its
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
from mapmore_cli.domain.errors import DataError, UsageError, Warn
from mapmore_cli.domain.foreign import PLAIN, plain, tex_text, xml_text
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.expressions.functions import FUNCTIONS, HELPER
from mapmore_cli.modelling.expressions.states import IDENTIFIER
from mapmore_cli.modelling.programs import program_of


@dataclass(frozen=True)
class Wanted:
    """Options of an export: `single` is True for single precision, `grid` gives the points of a
    table, and `verify` is True if the code is compared with `predict`. `warn` is called with a
    message if something could not be done.
    """

    single: bool
    grid: str | None
    verify: bool
    warn: Warn


class Code(str):
    """A text that mapmore's own printers made. Such a text contains no text of users or files, so
    it can be inserted without escaping.
    """

    __slots__ = ()


def word(text: str) -> Code:
    """Return the text as code if it is an identifier. Raises DataError otherwise."""
    if not IDENTIFIER.fullmatch(text):
        problem = f"the model calls something {plain(text)[:60]!r}, which cannot be a name in code"
        raise DataError(problem, "make the model again with names of letters, digits and _")
    return Code(text)


def code(form: str, *parts: Code | str | float) -> Code:
    """Return code made from a pattern. Its braces are replaced by code, numbers, or texts that must
    be identifiers.
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
    *["np", "float", "s", "finite", "_beyond", "state", "State", "step", "evaluate"],
    *map(HELPER.format, FUNCTIONS),
)
"""Names in functions of a module that its inputs must not hide."""

OWN = (
    *PYTHON,
    *[
        "outside_range",
        "derivatives",
        "reset",
        "eval",
        "valid",
        "measured",
        "math",
        "in",
        "out",
        "outside",
        "x",
        "n",
        "j",
        "k",
        "y",
        "given",
        "largest",
        "shape",
        "value",
        "one_sample",
        "beyond",
        "interpolated",
        "begun",
        "places",
        "values",
        "validity",
        "fileName",
        "cellfun",
        "numel",
        "size",
        "ones",
        "isempty",
        "verify_model",
        "power_of",
    ],
)
"""Names in the templates of all languages, which no output and no model may have."""

_FUNCTION = re.compile("(curve|segment)_[0-9]+|slope_(inside|at_end)")
"""Pattern of the names that functions of programs have."""


def identifier(name: str) -> Code:
    """Return the name of a model's functions and files, in which `_` replaces characters that C
    does not allow. `model_` is put before a name that begins with a digit, and before a name that a
    language, its library or a template uses. It is also put before `x` and `x_...`, because
    `x_reset` is an input in C. Raises UsageError if the name has neither a letter nor a digit.
    """
    # compilers distinguish the first 63 characters of a name, including characters that are added
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
    """Return the names of the inputs in code, as a mapping from the name of an input in the model
    to its name in code. No name in code is equal to one of the `functions`.
    """
    names = [quantity.name for quantity in inputs]
    reserved = [*PYTHON, *functions, *(f"x_{name}" for name in names)]
    return dict(zip(names, identifiers(names, reserved), strict=True))


def names_in_matlab(inputs: Sequence[Quantity], functions: Sequence[str]) -> dict[str, str]:
    """Return what `names_of_inputs` returns, with names that are allowed in MATLAB and Octave."""
    return names_of_inputs(inputs, [*words_of("MATLAB", "Octave"), *functions])


def name_of_output(model: Model, names: Iterable[str] | None = None) -> Code:
    """Return the name of the output in code, where it is the name of a function or a variable.
    `names` are the names of the inputs in code, by default the result of `names_of_inputs`.
    """
    input_names = [*(names_of_inputs(model.inputs).values() if names is None else names)]
    functions = [function.name for function in program_of(model).functions]
    reserved = [*TAKEN, *OWN, *functions, identifier(model.name), *input_names]
    reserved += [f"invert_{name}" for name in input_names]
    return word(identifiers([model.output.name], reserved)[0])


def notes_of(model: Model, names: Mapping[str, str]) -> list[str]:
    """Return notes for the head of an exported file: a line for each input whose name in code
    differs from its name in the model, and a line with the shape conditions that the model fulfils,
    for example that the output increases with an input.
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
    """Return the text as a string in C. Bytes outside `PLAIN` are octal escapes, so that there are
    no trigraphs.
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
"""Function that writes a text as a literal of a language, by the suffix of its files."""


@cache
def templates(language: str) -> Environment:
    """Return the Jinja environment that fills the templates of a language in `sources/`."""

    def written(value: object) -> object:
        if isinstance(value, Code | int | float):
            return value
        if isinstance(value, str):
            return LITERALS[language](str(value))
        raise TypeError(f"neither a text nor a number: {value!r}")

    def noted(text: str) -> Code:
        # in a web page, the text `</script>` ends a script even inside a comment of the script
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
    environment.filters["unit"] = lambda quantity: noted(quantity.label)
    return environment


def note(text: str) -> Code:
    """Return a text as code that is safe inside a comment, because it cannot end the comment.
    Outside of comments, this code must not be used.
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
    """Return the text of a file with the notice that the licence of mapmore's templates requires,
    if the file is code. In MATLAB, the notice stands at the end of the file, because the first
    comment of a file is the help of its function.
    """
    comment = COMMENTS.get(PurePath(name).suffix)
    if comment is None:
        return text
    line = comment.format(NOTICE)
    return f"{text}\n{line}\n" if name.endswith(".m") else f"{line}\n{text}"


def rendered_template(template: str, **words: object) -> Code:
    """Return a file of `sources/` with values in place of its template variables."""
    return Code(
        templates(template.rpartition(".")[2]).get_template(f"{template}.jinja").render(words)
    )


def source(name: str) -> str:
    """Return a file of `sources/` unchanged."""
    return files(__package__).joinpath("sources", name).read_text(encoding="utf-8")
