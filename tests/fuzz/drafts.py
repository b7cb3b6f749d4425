"""`init`: folders of recordings with titles, units and values of all sorts; a draft is a spec that
loads, or the folder is refused.
"""

from __future__ import annotations

import random
import shutil
from contextlib import suppress

import numpy as np
import readers
from driver import Fault, Target, refused
from specs import is_yaml

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.study.loader import load
from mapmore_cli.study.units import convert

TITLES = (
    *(
        "time",
        "t [s]",
        "Zeit (ms)",
        "P",
        "pressure (kPa)",
        "Druck [bar]",
        "p_psi",
        "eps",
        "strain",
        "contraction (%)",
        "F",
        "force [N]",
    ),
    *(
        "Kraft/N",
        "length mm",
        "x",
        "x",
        "",
        "\u0430",
        "=1+1",
        "[",
        "a" * 200,
        "1",
        "\x1b[2J",
        "unnamed: 0",
        "CH1 [V]",
    ),
)


def recording(chance, pressure):
    """A table of a muscle at one pressure, or of noise, as text."""
    n, mark = chance.choice([3, 12, 30, 60]), chance.choice([",", ",", ";", "\t"])
    strain = np.linspace(0, 0.2, n)
    columns = [np.arange(n) * 0.1, np.full(n, pressure), strain, 2 * pressure * (1 - 3 * strain)]
    if chance.random() < 0.3:
        columns[chance.randrange(4)] = np.array(
            [
                chance.choice([0.0, 1e300, -5.0, 1e-300, float("nan"), chance.random()])
                for _ in range(n)
            ]
        )
    titles = (
        ["t", "P", "eps", "F"]
        if chance.random() < 0.4
        else [chance.choice(TITLES) for _ in range(4)]
    )
    lines = [mark.join(titles)] if chance.random() < 0.9 else []
    lines += [mark.join(["s", "kPa", "1", "N"])] if chance.random() < 0.2 else []
    lines += [mark.join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join(lines) + "\n"


def attempt(chance, number, folder):
    """Draft a spec of one to three files; what is drafted is YAML, and one in four is loaded,
    beside what `init` itself loads.
    """
    place = folder / f"logs{number}"
    place.mkdir()
    for pressure in (100, 200, 300)[: chance.choice([1, 2, 3])]:
        name = f"run_{pressure}{chance.choice(['kPa', '', 'psi'])}"
        if chance.random() < 0.8:
            (place / f"{name}.csv").write_text(recording(chance, pressure), errors="replace")
        else:
            (place / f"{name}.{chance.choice(['csv', 'txt'])}").write_bytes(readers.text(chance))
    try:
        answers = Answers(length=chance.choice([None, None, 0.088]))
        drafts = start(place, folder, answers=answers).drafts
    except MapmoreError as error:
        return refused(error)
    else:
        for draft in drafts:
            text = draft.text()
            if not is_yaml(text):
                raise Fault("a draft that is no YAML")
            if number % 4 == 0:
                (folder / "draft.yaml").write_text(text, encoding="utf-8")
                load(folder / "draft.yaml")
        return "drafted"
    finally:
        shutil.rmtree(place)


def warm(folder):
    convert(1.0, "lbf/ft^2", "kPa")
    (folder / "warm.csv").write_text(recording(random.Random(1), 200))
    with suppress(MapmoreError):  # what a stranger wrote may be refused
        start(folder / "warm.csv", folder)


TARGET = Target("init", attempt, past=("drafted",), longest=10, warm=warm)
