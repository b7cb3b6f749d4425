"""Find groups of recordings in the names of files: specimens or sessions, and files for tests."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from mapmore_cli.annexes.drafting.name_numbers import BY_WORD, NUMBER, RUNS, UNITS
from mapmore_cli.annexes.drafting.names import NamedCondition
from mapmore_cli.annexes.drafting.spelling import words

_TRAINS = {"train", "training", "estimation", "identification"}
_TESTS = {"test", "testing", "val", "valid", "validation"}


def numbered_groups(names: Sequence[str], group: str) -> NamedCondition:
    """Return a quantity that numbers the groups of recordings: its value for each file is the
    number of the group to which the file belongs. `group` is a word such as `sample`. The groups
    are found in the names of the files.
    """
    groups = group_words(names, group)
    apart = sorted({*groups})
    values = tuple(apart.index(word) + 1.0 for word in groups)
    return NamedCondition(group, "", values, f"{group} 1 is {apart[0]!r}, and so on")


def group_words(names: Sequence[str], group: str) -> list[str]:
    """Return, for each name, the text that distinguishes its group. Several kinds of text are tried
    in this order, until every name contains a text of this kind, and not all of them are equal:

    - the number or letter after the word `group`;
    - the number after the first letter of `group`, for example `1` in `s1` for the group `sample`;
    - the name without its numbers, except for specimens and for sizes such as `10cm`;
    - the whole name.
    """
    behind = re.compile(
        rf"{re.escape(group)}\w*?[\s_#=.-]*(\d+|[A-Za-z])(?![^\W\d_])", re.IGNORECASE
    )
    letter = re.compile(rf"(?<![^\W\d_]){re.escape(group[0])}(\d+)", re.IGNORECASE)
    marks, letters = (
        [match[1] if (match := way.search(name)) else "" for name in names]
        for way in (behind, letter)
    )
    bare = [NUMBER.sub(_without_number, name) for name in names]
    ways = (texts for texts in (marks, letters, bare) if all(texts) and len(set(texts)) > 1)
    return next(ways, list(names))


def _without_number(match: re.Match[str]) -> str:
    """Return the text by which a number in a name, with its word and its unit, is replaced. It is
    the word if the number has a unit, and an empty text if the number has neither a unit nor a
    word, or counts repeated tests. Numbers of specimens, and sizes such as `10cm`, stay unchanged.
    """
    word, unit = match["word"] or "", (match["unit"] or "").casefold()
    if unit:
        return match[0] if UNITS[unit][0] in BY_WORD else word
    return "" if not word or re.fullmatch(RUNS, word, re.IGNORECASE) else match[0]


def files_for_tests(files: Sequence[Path]) -> list[str]:
    """Return the names of files that contain `test` or `validation`, if all others contain
    `train`.
    """
    tests, trains = (
        {file for file in files if marks & {*words(file.stem)}} for marks in (_TESTS, _TRAINS)
    )
    divided = tests and trains and not tests & trains and len(tests) + len(trains) == len(files)
    return [file.name for file in files if divided and file in tests]
