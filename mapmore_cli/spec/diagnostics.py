"""Mistakes in a spec: collected with their places, shown all at once."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NoReturn

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from mapmore_cli.domain.declared import Contradiction, shape
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.tree import Loc, Node, Position, keys_at, nearest

_WIDEST = 110  # characters of a source line that are shown
_MOST = 25  # mistakes that are shown


@dataclass(frozen=True)
class Mistake:
    """One mistake: where, what is wrong, and what would be right."""

    at: Position
    message: str
    remedy: str | None = None


@dataclass(frozen=True)
class Finding:
    """A mistake named by its way through the spec rather than by its place in a file.

    `offset` is the place of the mistake within a text value, as of a syntax error in an expression; `on_key` puts it on the key.
    """

    loc: Loc
    message: str
    remedy: str | None = None
    offset: int = 0
    on_key: bool = False


def locate(finding: Finding, root: Node) -> Mistake:
    """Return the finding with its place; a value that the sources do not hold is placed at its nearest ancestor."""
    node = nearest(root, finding.loc)
    at = node.start if finding.on_key or len(finding.loc) == 0 else node.at
    return Mistake(within(at, node.value, finding.offset), finding.message, finding.remedy)


def within(at: Position, value: object, offset: int) -> Position:
    """Return the place of character `offset` of a text that starts at `at`; `at` itself where the source spells the text differently."""
    written = _line(at)[at.column - 1 :]
    for quote in ("", '"', "'"):
        if isinstance(value, str) and offset and written.startswith(quote + value):
            return Position(at.source, at.line, at.column + len(quote) + offset)
    return at


def did_you_mean(word: str, known: Iterable[str], otherwise: str = "known are") -> str | None:
    """`did you mean ...?` for a near miss, else the list of what is known; None where nothing is."""
    words = list(dict.fromkeys(known))
    lower = {candidate.casefold(): candidate for candidate in words}
    near = get_close_matches(word[:_WIDEST].casefold(), lower, n=1, cutoff=0.6)
    if near:
        return f"did you mean `{lower[near[0]]}`?"
    return f"{otherwise} {', '.join(f'`{candidate}`' for candidate in words)}" if words else None


def new_places(problems: Iterable[Mistake], known: Sequence[Mistake]) -> list[Mistake]:
    """Problems where none is known yet: the later ones at the same place are consequences of the first."""
    taken = {problem.at for problem in known}
    return [problem for problem in problems if problem.at not in taken]


def raise_if_any(problems: Sequence[Mistake]) -> None:
    """Raise one SpecError that shows every problem, in the order of the sources."""
    if not problems:
        return
    sources = list(dict.fromkeys(problem.at.source for problem in problems))
    ordered = sorted(problems, key=lambda problem: (sources.index(problem.at.source), problem.at.line, problem.at.column))
    blocks = [_block(problem) for problem in dict.fromkeys(ordered)]
    if len(blocks) > _MOST:
        blocks = [*blocks[:_MOST], f"... and {'at least ' if len(blocks) >= MOST_ERRORS else ''}{len(blocks) - _MOST} more mistakes"]
    raise SpecError("\n\n".join(blocks))


def fail(at: Position, message: str, remedy: str | None = None) -> NoReturn:
    """Raise a SpecError about one mistake that makes further reading pointless."""
    raise SpecError(_block(Mistake(at, message, remedy)))


def _block(problem: Mistake) -> str:
    """Return the place and the message, the source line with a caret, the remedy."""
    remedy = [] if problem.remedy is None else [f"  {problem.remedy}"]
    return "\n".join([f"{problem.at}: {problem.message}", *_snippet(problem.at), *remedy])


def _snippet(at: Position) -> list[str]:
    line = _line(at)
    if not at.source.numbered or not line.strip():
        return []
    start = max(0, at.column - 1 - _WIDEST // 2) if len(line) > _WIDEST else 0
    shown = "".join(char if char.isprintable() else " " for char in line[start : start + _WIDEST])
    number = f"{at.line:6d} | "
    return [number + shown, " " * (len(number) - 2) + "| " + " " * (at.column - 1 - start) + "^"]


def _line(at: Position) -> str:
    """Return the source line; cut as YAML counts lines, and not as `str.splitlines` does."""
    lines = re.split("\r\n|[\r\n\x85\u2028\u2029]", at.source.text)
    return lines[at.line - 1] if at.line <= len(lines) else ""


Explained = tuple[str, str | None]
"""What is wrong, and what would be right."""

MOST_ERRORS = 200
"""Errors that are explained: a list of thousands of wrong values is one mistake."""

_EXPECTED = {
    "string_type": "text",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "bool_type": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "dataclass_type": "a mapping",
}
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_BOUNDS = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}


def explain(error: ValidationError, root: Node, model: type[BaseModel]) -> list[Mistake]:
    """One problem for each mistake that pydantic found in the tree: a key that is missing because it is misspelt is one mistake."""
    errors = error.errors(include_url=False)[:MOST_ERRORS]
    meant = {_meant(details["loc"], root, model) for details in errors if details["type"] in _UNKNOWN}
    return [_problem(details, root, model) for details in errors if _split(details["loc"], root) not in meant]


def faulty(error: ValidationError, root: Node) -> list[Loc]:
    """Return the ways to what pydantic refused: values, and sections that are incomplete."""
    return [_split(details["loc"], root)[0] for details in error.errors(include_url=False)]


def unknown_keys(error: ValidationError, root: Node, model: type[BaseModel]) -> dict[Loc, Loc | None]:
    """Return the ways to unknown keys, each with that to the key meant; None where it is near to no key that the spec lacks."""
    found: dict[Loc, Loc | None] = {}
    for details in error.errors(include_url=False):
        if details["type"] in _UNKNOWN:
            loc, _ = _split(details["loc"], root)
            section = nearest(root, loc[:-1])
            near = get_close_matches(str(loc[-1]), keys_at(model, loc[:-1]), n=1)
            found[loc] = (*loc[:-1], near[0]) if near and section.child(near[0]) is None else None
    return found


def _problem(details: ErrorDetails, root: Node, model: type[BaseModel]) -> Mistake:
    loc, rest = _split(details["loc"], root)
    node = nearest(root, loc)
    context: Mapping[str, Any] = details.get("ctx", {})
    misspelt = _misspelt_key(loc, root, model)
    if misspelt is not None:
        return misspelt
    match details["type"]:
        case "extra_forbidden" | "unexpected_keyword_argument":
            return Mistake(node.start, *_unknown_key(loc, model))
        case "missing" if isinstance(rest[-1], int):
            return Mistake(node.at, f"{_name(loc)} has too few values", "give two: `[low, high]`")
        case "missing":
            return Mistake(node.start, f"{_name(loc)} lacks the key `{rest[-1]}`", f"add `{rest[-1]}: ...`")
        case "value_error" if isinstance(found := context["error"], Contradiction):
            beside = [node.child(key) for key in found.near]
            at = next((child.start for child in beside if child is not None), node.start)
            return Mistake(at, found.message, found.remedy)
        case "string_pattern_mismatch" if rest and rest[-1] == "[key]":
            return Mistake(
                node.start, f"{str(loc[-1])!r} cannot be the name of a quantity", "use letters, digits and `_`, as `step_pressure`"
            )
        case kind:
            return Mistake(node.at, *_value(kind, node.value, context, details["msg"], _name(loc)))


def _value(kind: str, value: object, context: Mapping[str, Any], said: str, name: str) -> Explained:
    """Explain an error about one value alone."""
    if kind in _EXPECTED:
        return f"{name} should be {_EXPECTED[kind]}, but is {_shown(value)}", _shape_remedy(_EXPECTED[kind], value)
    if kind in _BOUNDS:
        key, words = _BOUNDS[kind]
        return f"{name} should be {words} {context[key]:g}, but is {_shown(value)}", None
    return _OTHERS.get(kind, _plainly)(value, context, said, name)


def _literal(value: object, context: Mapping[str, Any], _said: str, name: str) -> Explained:
    known = re.findall(r"'([^']*)'", context["expected"]) or [context["expected"]]
    return f"{name} cannot be {_shown(value)}", did_you_mean("" if isinstance(value, dict | list) else str(value), known, "possible are")


def _no_member(value: object, context: Mapping[str, Any], _said: str, name: str) -> Explained:
    expected = " or ".join(re.findall(r"<([^>]*)>", context["expected_tags"]))
    return f"{name} should be {expected}, but is {_shown(value)}", _shape_remedy(expected, value)


def _pattern(value: object, _context: Mapping[str, Any], _said: str, name: str) -> Explained:
    return f"{name} cannot be {_shown(value)}", "start with a letter or digit, and go on with letters, digits, `.`, `_` and `-`"


def _too_long(value: object, context: Mapping[str, Any], _said: str, name: str) -> Explained:
    return f"{name} is too long: {len(str(value))} characters", f"use {context['max_length']} at most"


def _too_few(_value: object, context: Mapping[str, Any], _said: str, name: str) -> Explained:
    return f"{name} is empty", f"give at least {context['min_length']}"


def _too_many(value: object, context: Mapping[str, Any], _said: str, name: str) -> Explained:
    return f"{name} has too many values: {_shown(value)}", f"give {context['max_length']}"


def _not_finite(value: object, _context: Mapping[str, Any], _said: str, name: str) -> Explained:
    return f"{name} should be a finite number, but is {value}", None


def _raised(_value: object, context: Mapping[str, Any], _said: str, _name: str) -> Explained:
    return str(context["error"]), None


def _plainly(_value: object, _context: Mapping[str, Any], said: str, name: str) -> Explained:
    return f"{name}: {said}", None


_OTHERS: Mapping[str, Callable[[object, Mapping[str, Any], str, str], Explained]] = {
    "literal_error": _literal,
    "union_tag_invalid": _no_member,
    "string_pattern_mismatch": _pattern,
    "string_too_long": _too_long,
    "too_short": _too_few,
    "too_long": _too_many,
    "finite_number": _not_finite,
    "value_error": _raised,
}


def _split(loc: Loc, root: Node) -> tuple[tuple[str | int, ...], tuple[str | int, ...]]:
    """Return the part of pydantic's way that the tree holds, and the rest: tags of unions, and the key that is missing."""
    node = root
    held: list[str | int] = []
    rest: list[str | int] = []
    for step in loc:
        below = node.child(step)
        if below is None:
            rest.append(step)
        else:
            node = below
            held.append(step)
    return tuple(held), tuple(rest)


def _misspelt_key(loc: Loc, root: Node, model: type[BaseModel]) -> Mistake | None:
    """Return a key that would be a quantity, as keys of `split.validate` may be, but whose value says that a near one is meant."""
    for depth, key in enumerate(loc):
        known = keys_at(model, loc[:depth])
        if known and isinstance(key, str) and key not in known and get_close_matches(key, known, n=1, cutoff=0.75):
            return Mistake(nearest(root, loc[: depth + 1]).start, *_unknown_key(loc[: depth + 1], model))
    return None


def _meant(loc: Loc, root: Node, model: type[BaseModel]) -> tuple[Loc, Loc]:
    """Return the way to the key that an unknown one is near to, split as `_split` does for a missing key."""
    held, _ = _split(loc, root)
    return held[:-1], tuple(get_close_matches(str(held[-1]), keys_at(model, held[:-1]), n=1))


def _unknown_key(loc: Loc, model: type[BaseModel]) -> Explained:
    inside = f" in `{_dotted(loc[:-1])}`" if len(loc) > 1 else ""
    return f"unknown key `{loc[-1]}`{inside}", did_you_mean(str(loc[-1]), keys_at(model, loc[:-1]))


def _name(loc: Loc) -> str:
    return f"`{_dotted(loc)}`" if loc else "the spec"


def _dotted(loc: Loc) -> str:
    """`data.files[0].path`, with quantities as they are."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in loc).lstrip(".")


def _shown(value: object) -> str:
    """Return a value in a message: its kind, and itself where it is short."""
    kind = shape(value).strip("<>")
    if value is None:
        return "empty"
    if isinstance(value, dict | list):
        return kind
    text = str(value)
    text = text if len(text) <= 40 else text[:40] + "..."
    return f"the text {text!r}" if isinstance(value, str) else text.lower() if isinstance(value, bool) else text


def _shape_remedy(expected: str, value: object) -> str | None:
    if expected == "text" and isinstance(value, bool | int | float):
        return "put it in quotes"
    if "number" in expected and isinstance(value, str) and re.fullmatch(r"\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)?\s*", value):
        return "remove the quotes"
    if "a list" in expected and isinstance(value, str | int | float):
        return f"write `[{value}]`"
    return None
