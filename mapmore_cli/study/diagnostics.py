"""Collect the mistakes of a spec with their places in the files, explain them, and show all of them
at once.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, NoReturn

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from mapmore_cli.domain.declared import Contradiction, shape
from mapmore_cli.domain.errors import MapmoreError, SpecError
from mapmore_cli.study.tree import Loc, Node, Position, nearest, quoted

_WIDEST = 110  # largest number of characters of a source line that is shown
_MOST = 25  # largest number of mistakes that is shown


@dataclass(frozen=True)
class Mistake:
    """A mistake in a spec: its place, a description, and the correction."""

    at: Position
    message: str
    remedy: str | None = None


@dataclass(frozen=True)
class Finding:
    """A mistake at a path through the spec, instead of a place in a file.

    The path is a sequence of keys and list indices, or a text such as `data.cycles`. A colon at its
    end, or `on_key`, places the mistake at the key instead of its value. `offset` is the position
    within a text value, for example of a syntax error in an expression.
    """

    way: Loc | str
    message: str
    remedy: str | None = None
    offset: int = 0
    on_key: bool = False

    @property
    def loc(self) -> Loc:
        """Path of the mistake as keys and list indices."""
        if not isinstance(self.way, str):
            return self.way
        steps = self.way.removesuffix(":").split(".")
        return [int(step) if step.isdecimal() else step for step in steps]


def locate(finding: Finding, root: Node) -> Mistake:
    """Return the mistake with its place in a file. If the value is not in a file, the place is that
    of the nearest section around it.
    """
    node = nearest(root, finding.loc)
    on_key = (
        finding.on_key
        or not finding.loc
        or (isinstance(finding.way, str) and finding.way.endswith(":"))
    )
    at = node.start if on_key else node.at
    if finding.offset and isinstance(node.value, str):
        written = _source_line(at)[at.column - 1 :]
        # no `quote` fits if the source spells the text in another way, for example with escapes
        for quote in ("", '"', "'"):
            if written.startswith(quote + node.value):
                at = replace(at, column=at.column + len(quote) + finding.offset)
                break
    return Mistake(at, finding.message, finding.remedy)


def applying(*rows: tuple[bool, Loc | str, str, str], **known: object) -> Iterator[Finding]:
    """Yield a finding for each row whose condition is True. A row consists of the condition, the
    path, the description of the mistake, and the correction.

    The path and the two texts are templates: `{name}` is replaced by the keyword argument `name`,
    and `{{` is a brace.
    """
    for applies, way, *texts in rows:
        if applies:
            place = way.format(**known) if isinstance(way, str) else way
            fault, remedy = (text.format(**known) for text in texts)
            yield Finding(place, fault, remedy)


def refused(
    way: Loc | str, attempt: Callable[..., object], *arguments: object
) -> Iterator[Finding]:
    """Call `attempt` with the arguments. If it raises a MapmoreError, yield a finding with this
    message at the path `way`.
    """
    try:
        attempt(*arguments)
    except MapmoreError as error:
        yield Finding(way, error.message, error.remedy)


def did_you_mean(word: str, known: Iterable[str], otherwise: str = "known are") -> str | None:
    """Return `did you mean ...?` if a known name resembles the word, and otherwise a text that
    lists the known names. Return None if there are no known names.
    """
    words = list(dict.fromkeys(known))
    lower = {candidate.casefold(): candidate for candidate in words}
    near = get_close_matches(word[:_WIDEST].casefold(), lower, n=1, cutoff=0.6)
    if near:
        return f"did you mean `{lower[near[0]]}`?"
    return f"{otherwise} {quoted(words)}" if words else None


def raise_if_any(problems: Sequence[Mistake]) -> None:
    """Raise one SpecError that shows every mistake, in the order of the sources."""
    if not problems:
        return
    sources = list(dict.fromkeys(problem.at.source for problem in problems))
    ordered = sorted(
        problems,
        key=lambda problem: (sources.index(problem.at.source), problem.at.line, problem.at.column),
    )
    blocks = [_mistake_text(problem) for problem in dict.fromkeys(ordered)]
    if len(blocks) > _MOST:
        least = "at least " if len(blocks) >= MOST_ERRORS else ""
        blocks = [*blocks[:_MOST], f"... and {least}{len(blocks) - _MOST} more"]
    raise SpecError("\n\n".join(blocks))


def fail(at: Position, message: str, remedy: str | None = None) -> NoReturn:
    """Raise a SpecError for a mistake after which the rest of the spec cannot be read."""
    raise SpecError(_mistake_text(Mistake(at, message, remedy)))


def _mistake_text(problem: Mistake) -> str:
    at, line = problem.at, _source_line(problem.at)
    lines = [f"{at}: {problem.message}"]
    if at.source.numbered and line.strip():
        start = max(0, at.column - 1 - _WIDEST // 2) if len(line) > _WIDEST else 0
        shown = "".join(
            char if char.isprintable() else " " for char in line[start : start + _WIDEST]
        )
        lines += [f"{at.line:6d} | {shown}", f"{'|':>8} {' ' * (at.column - 1 - start)}^"]
    return "\n".join(lines if problem.remedy is None else [*lines, f"  {problem.remedy}"])


def _source_line(at: Position) -> str:
    """Return the line of the source at a position. The text is cut into lines at the same
    characters as in YAML; `str.splitlines` also cuts at other characters.
    """
    lines = re.split("\r\n|[\r\n\x85\u2028\u2029]", at.source.text)
    return lines[at.line - 1] if at.line <= len(lines) else ""


# Faults from pydantic
# --------------------------------------------------------------------------------------------------

Explained = tuple[str, str | None]
"""Description of a mistake, and its correction or None."""

MOST_ERRORS = 200
"""Largest number of errors of pydantic that are explained. A list of thousands of wrong values is
only one mistake.
"""

_EXPECTED = {
    "string_type": "text",
    **dict.fromkeys(("int_type", "int_from_float"), "a whole number"),
    "float_type": "a number",
    "bool_type": "true or false",
    **dict.fromkeys(("list_type", "tuple_type", "is_instance_of", "sequence_str"), "a list"),
    **dict.fromkeys(
        ("dict_type", "model_type", "model_attributes_type", "dataclass_type"), "a mapping"
    ),
}
_SAID: dict[str, tuple[str, str | None]] = {
    "greater_than": ("should be greater than {gt:g}, but is {shown}", None),
    "greater_than_equal": ("should be at least {ge:g}, but is {shown}", None),
    "less_than": ("should be less than {lt:g}, but is {shown}", None),
    "less_than_equal": ("should be at most {le:g}, but is {shown}", None),
    "finite_number": ("should be a finite number, but is {value}", None),
    "string_pattern_mismatch": (
        "cannot be {shown}",
        "start with a letter or digit, and go on with letters, digits, `.`, `_` and `-`",
    ),
    "string_too_long": ("is too long: {size} characters", "use {max_length} at most"),
    "too_short": ("is empty", "give at least {min_length}"),
    "too_long": ("has too many values: {shown}", "give {max_length}"),
}
"""For each kind of error of pydantic: the description of the mistake, and its correction."""
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")


KeysAt = Callable[[Loc], Sequence[str]]
"""Function that returns the keys that are allowed at a path."""


def explain(error: ValidationError, root: Node, keys_at: KeysAt) -> list[Mistake]:
    """Return one mistake for each fault that pydantic found in the tree. If a required key is
    misspelt, pydantic finds two faults: an unknown key and a missing key. Only the first is
    returned.
    """
    errors = error.errors()[:MOST_ERRORS]
    unknown = [_split(details["loc"], root)[0] for details in errors if details["type"] in _UNKNOWN]
    meant = {
        (loc[:-1], tuple(get_close_matches(str(loc[-1]), keys_at(loc[:-1]), n=1)))
        for loc in unknown
    }
    return [
        _problem(details, root, keys_at)
        for details in errors
        if _split(details["loc"], root) not in meant
    ]


def lost(error: ValidationError, root: Node, keys_at: KeysAt) -> Iterator[tuple[Loc, Loc | None]]:
    """Yield two paths for each value or section that pydantic rejected. The first is its own path,
    at which it can be removed. The second is the path of the key that the spec lacks if it is
    removed.

    Usually, both paths are equal. An unknown key, however, may be a misspelt one: its second path
    is that of a similar key that the section lacks, or None if there is no such key.
    """
    for details in error.errors():
        loc, _ = _split(details["loc"], root)
        meant: Loc | None = loc
        if details["type"] in _UNKNOWN:
            near = get_close_matches(str(loc[-1]), keys_at(loc[:-1]), n=1)
            meant = (
                (*loc[:-1], near[0])
                if near and nearest(root, loc[:-1]).child(near[0]) is None
                else None
            )
        yield loc, meant


def _problem(details: ErrorDetails, root: Node, keys_at: KeysAt) -> Mistake:
    loc, rest = _split(details["loc"], root)
    node = nearest(root, loc)
    name = f"`{_dotted(loc)}`" if loc else "the spec"
    # The unknown key was read as the name of a quantity, but a similar known key was meant.
    for depth, key in enumerate(loc, start=1):
        known = keys_at(loc[: depth - 1])
        near = () if key in known else get_close_matches(str(key), known, n=1, cutoff=0.75)
        if near:
            return Mistake(nearest(root, loc[:depth]).start, *_unknown_key(loc[:depth], known))
    match details["type"]:
        case kind if kind in _UNKNOWN:
            return Mistake(node.start, *_unknown_key(loc, keys_at(loc[:-1])))
        case "missing" if isinstance(rest[-1], int):
            return Mistake(node.at, f"{name} has too few values", "give two: `[low, high]`")
        case "missing":
            return Mistake(
                node.start, f"{name} lacks the key `{rest[-1]}`", f"add `{rest[-1]}: ...`"
            )
        case "value_error" if isinstance(clash := details["ctx"]["error"], Contradiction):
            beside = [node.child(key) for key in clash.near]
            otherwise = node.start if clash.near else node.at
            at = next((child.start for child in beside if child is not None), otherwise)
            return Mistake(at, clash.message, clash.remedy)
        case "string_pattern_mismatch" if rest and rest[-1] == "[key]":
            message = f"{str(loc[-1])!r} cannot be the name of a quantity"
            return Mistake(
                node.start, message, "use letters, digits and `_`, for example `step_pressure`"
            )
    # the message shows a number with a unit as converted to the unit of the model
    value = details["input"] if isinstance(details["input"], float) else node.value
    return Mistake(node.at, *_of_value(details, value, name))


def _of_value(details: ErrorDetails, value: object, name: str) -> Explained:
    known: dict[str, Any] = details.get("ctx", {})
    kind, shown = details["type"], _value_in_words(value)
    expected = _EXPECTED.get(kind)
    if kind == "union_tag_invalid":
        expected = " or ".join(re.findall(r"<([^>]*)>", known["expected_tags"]))
    if expected is not None:
        return f"{name} should be {expected}, but is {shown}", _shape_remedy(expected, value)
    if kind == "literal_error":
        words = re.findall(r"'([^']*)'", known["expected"]) or [known["expected"]]
        word = "" if isinstance(value, dict | list) else str(value)
        return f"{name} cannot be {shown}", did_you_mean(word, words, "possible are")
    if kind == "value_error":
        return str(known["error"]), None
    if kind not in _SAID:
        return f"{name}: {details['msg']}", None
    known = {
        **known,
        "shown": shown,
        "value": value,
        "size": len(value) if isinstance(value, str) else 0,
    }
    fault, remedy = (text and text.format(**known) for text in _SAID[kind])
    return f"{name} {fault}", remedy


def _split(loc: Loc, root: Node) -> tuple[tuple[str | int, ...], tuple[str | int, ...]]:
    """Return pydantic's path in two parts: the steps that exist in the tree, and the other steps.
    The other steps are tags of unions, and the key that is missing.
    """
    node = root
    held: list[str | int] = []
    rest: list[str | int] = []
    for step in loc:
        below = node.child(step)
        (rest if below is None else held).append(step)
        node = below or node
    return tuple(held), tuple(rest)


def _unknown_key(loc: Loc, known: Iterable[str]) -> Explained:
    inside = f" in `{_dotted(loc[:-1])}`" if len(loc) > 1 else ""
    words = [step for step in loc if isinstance(step, str)]
    return f"unknown key `{words[-1]}`{inside}", did_you_mean(words[-1], known)


def _dotted(loc: Loc) -> str:
    """Return a path as text, for example `data.files[0].path`."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in loc).lstrip(".")


def _value_in_words(value: object) -> str:
    """Return the description of a value for a message: its type, and the value itself if it is
    short.
    """
    if value is None:
        return "empty"
    if isinstance(value, dict | list):
        return shape(value).strip("<>")
    text = str(value)
    text = text if len(text) <= 40 else text[:40] + "..."
    if isinstance(value, str):
        return f"the text {text!r}"
    return text.lower() if isinstance(value, bool) else text


def _shape_remedy(expected: str, value: object) -> str | None:
    if expected == "text" and isinstance(value, bool | int | float):
        return "put it in quotes"
    if (
        "number" in expected
        and isinstance(value, str)
        and re.fullmatch(r"\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)?\s*", value)
    ):
        return "remove the quotes"
    if "a list" in expected and isinstance(value, str | int | float):
        return f"write `[{value}]`"
    return None
