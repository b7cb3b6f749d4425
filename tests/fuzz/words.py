"""Models that are called by a word of a language to which they are exported."""

from __future__ import annotations

import sys
from pathlib import Path

from driver import Fault, Target, refused

from mapmore_cli.annexes.exporting.templates import identifier
from mapmore_cli.annexes.exporting.words import FILES
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.modelling.expressions.functions import FUNCTIONS

sys.path.insert(0, str(Path(__file__).parents[1] / "exporting"))

COMPILED = 25
"""One word of so many is tried with a compiler or an interpreter, which takes a second."""


def attempt(chance, number, _folder):
    """No word remains as the name of a function or a file; and what is exported under some of them
    is compiled or run, and compared with `predict`.
    """
    from test_words_of_languages import EVERY, TO, check

    word = EVERY[number % len(EVERY)]
    if identifier(word).lower() in {one.lower() for one in (*EVERY, *FILES)}:
        raise Fault(f"{word} remains a name")
    if number % COMPILED:
        return "renamed"
    names = [one for one in EVERY if one not in FUNCTIONS and one.lower() != word.lower()]
    first, second = chance.sample(names, 2)
    try:
        check(word, (first, second), word, chance.choice(TO))
    except MapmoreError as error:
        if error.exit_code == 1:
            raise
        return refused(error)
    return "compared"


TARGET = Target("words", attempt, past=("renamed", "compared"), longest=60)
