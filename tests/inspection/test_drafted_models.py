"""Specimens that the names of files distinguish."""

from __future__ import annotations

import numpy as np
from recorded import checked, drafted, write

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.search.stage import search_slice


def pull(path, bar, strength):
    k = np.arange(40)
    write(
        path,
        {"P_kPa": 100 * bar, "eps": k / 300, "F_N": 100 * bar * strength - 9 * k + 0.02 * k**2},
    )


def test_the_groups_are_no_input_of_a_search(tmp_path):
    for number, word in ((1, "blue"), (2, "red")):
        for bar in (1, 2, 3):
            pull(tmp_path / f"{word}_pull_{bar}bar.csv", bar, 2 + number)
    draft = drafted(tmp_path, answers=Answers(group="specimen"))
    # the group explains the difference at equal inputs
    assert draft.data["groups"] == {"of": "specimen", "offset": True}
    assert draft.data["files"] == [
        {"path": f"{word}_pull_*.csv", "set": {"specimen": number}}
        for number, word in ((1, "blue"), (2, "red"))
    ]
    spec = checked(draft, tmp_path).spec
    assert search_slice(spec).ignored == ("force", "specimen")
