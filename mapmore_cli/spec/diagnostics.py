"""Mistakes in a spec: collected with their places, shown all at once."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import NoReturn

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.tree import Loc, Node, Position, nearest

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
    """The finding with its place; a value that the sources do not hold is placed at its nearest ancestor."""
    node = nearest(root, finding.loc)
    at = node.start if finding.on_key or len(finding.loc) == 0 else node.at
    return Mistake(within(at, node.value, finding.offset), finding.message, finding.remedy)


def within(at: Position, value: object, offset: int) -> Position:
    """The place of character `offset` of a text value that starts at `at`; `at` itself where the source spells the text differently."""
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
        blocks = [*blocks[:_MOST], f"... and {len(blocks) - _MOST} more mistakes"]
    raise SpecError("\n\n".join(blocks))


def fail(at: Position, message: str, remedy: str | None = None) -> NoReturn:
    """Raise a SpecError about one mistake that makes further reading pointless."""
    raise SpecError(_block(Mistake(at, message, remedy)))


def _block(problem: Mistake) -> str:
    """The place and the message, the source line with a caret, the remedy."""
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
    """The source line; cut as YAML counts lines, and not as `str.splitlines` does."""
    lines = re.split("\r\n|[\r\n\x85\u2028\u2029]", at.source.text)
    return lines[at.line - 1] if at.line <= len(lines) else ""
