"""What the names of files say: which belong together, what was held, and which are repeats."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mapmore_cli.stages.drafting.preview import suffix_of

_REPEAT = re.compile(r"(?:test|run|rep|repeat|trial|take|try|no|nr|cycle)?\d{1,2}", re.IGNORECASE)
_REPEAT_WORD = re.compile(r"test|run|rep|repeat|trial|take|try|no|nr", re.IGNORECASE)
_SIZE = re.compile(r"\d+(?:[.,]\d+)?(?:mm|cm|m|in)", re.IGNORECASE)
_NUMBER = re.compile(r"(\d+(?:[.,]\d+)?)(?:\s*)(kpa|pa|mpa|bar|mbar|psi|pct|percent|%)?(?![a-z0-9])", re.IGNORECASE)


@dataclass(frozen=True)
class NameParts:
    """What one name says among the others.

    `group` holds the words that tell studies apart (sizes of a muscle, kinds), `condition` the one that may say what was held; `is_repeat`
    says whether a number of a repeat is part of it.
    """

    group: tuple[str, ...]
    condition: str | None
    is_repeat: bool


def words_of(name: str) -> list[str]:
    """The words of a file's name, without its suffixes."""
    stem = name[:-3] if name.casefold().endswith(".gz") else name
    stem = stem[: len(stem) - len(suffix_of(Path(name)))]
    return [word for word in re.split(r"[_\s]+", stem) if word]


def read_names(names: Sequence[str]) -> list[NameParts]:
    """Compare names word by word; where they have different numbers of words they say nothing.

    Among the words that vary, sizes (`10cm`) and words without numbers tell groups apart, `Test8` is a repeat, and the last one of the
    others that some of the names have a number in is the condition.
    """
    split = [words_of(name) for name in names]
    if len({len(words) for words in split}) != 1:
        return [NameParts((), None, False) for _ in names]
    kinds = [
        "constant" if len(set(column)) == 1 else _kind(column, split[0][:place]) for place, column in enumerate(zip(*split, strict=True))
    ]
    numbered = [place for place, kind in enumerate(kinds) if kind == "condition"]
    held = numbered[-1] if numbered else None
    return [
        NameParts(
            tuple(word for word, kind in zip(words, kinds, strict=True) if kind == "group"),
            None if held is None else words[held],
            "repeat" in kinds,
        )
        for words in split
    ]


def number_in(word: str) -> tuple[float, str | None] | None:
    """The number at the end of a word with its unit of pressure or `%`: (25, None) of `kinked25`, (200, "kPa") of `200kPa`."""
    found = _NUMBER.search(word)
    if found is None:
        return None
    units = {"kpa": "kPa", "pa": "Pa", "mpa": "MPa", "bar": "bar", "mbar": "mbar", "psi": "psi", "pct": "%", "percent": "%", "%": "%"}
    return float(found[1].replace(",", ".")), units[found[2].casefold()] if found[2] else None


def _kind(column: Sequence[str], before: Sequence[str]) -> str:
    if all(_REPEAT.fullmatch(word) and (not word.isdigit() or _follows_repeat_word(before)) for word in column):
        return "repeat"
    if all(_SIZE.fullmatch(word) for word in column):
        return "group"
    return "condition" if any(number_in(word) for word in column) else "group"


def _follows_repeat_word(before: Sequence[str]) -> bool:
    return bool(before) and _REPEAT_WORD.fullmatch(before[-1]) is not None
