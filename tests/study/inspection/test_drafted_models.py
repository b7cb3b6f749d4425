"""The model that `init` writes: what a search finds on training data, with how it was found, and told where a plainer one is better."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded import drafted as untried
from recorded import write

from mapmore_cli.spec.loader import load
from mapmore_cli.study.drafting.draft import Draft, guesses_page
from mapmore_cli.study.drafting.proof import proven
from mapmore_cli.study.drafting.start import start

pytestmark = pytest.mark.usefixtures("fewer_families")


def table(folder: Path, levels: int, samples: int, force: Any) -> None:
    strain = np.linspace(0, 0.15, samples)
    for pressure in 100.0 * np.arange(1, levels + 1):
        write(folder / f"pull_{pressure:g}.csv", {"P [kPa]": pressure, "eps": strain, "F [N]": force(pressure, strain)})


def drafted(folder: Path) -> Draft:
    (draft,) = start(folder, folder, search=lambda one, place: proven(one, place, 20.0)).drafts
    return draft


def test_a_plane_is_found_where_it_is_all_that_there_is(tmp_path: Path) -> None:
    table(tmp_path, 6, 40, lambda p, e: 20 + 0.3 * p - 200 * e)
    draft = drafted(tmp_path)
    assert draft.found is not None
    assert draft.spec["dictionary"] == [{"polynomial": {"of": ["strain", "pressure"], "order": 1}}]
    assert "found by search: surface of order 1" in draft.text()
    assert "# tried: NRMSE" in draft.text()
    page = guesses_page(draft)
    assert "Structures that were tried" in page
    assert all(one.words in page for one in draft.found.tried)


def test_the_page_counts_all_files_and_those_that_are_drawn(tmp_path: Path) -> None:
    table(tmp_path, 7, 12, lambda p, e: p * (2 - 9 * e))
    draft = untried(tmp_path)
    drawn = len(draft.raw["eps"])
    assert drawn < 7
    assert f"made of 7 files, to be checked by eye; {drawn} of them are drawn</p>" in guesses_page(draft)


def test_held_out_levels_do_not_move_the_structure(tmp_path: Path) -> None:
    """What is held out is spoilt: the same structure is found, and the score tells of it."""
    found = []
    for spoil in (0.0, 40.0):
        folder = tmp_path / f"{spoil:g}"
        table(folder, 5, 60, lambda p, e, spoil=spoil: p * (2 - 9 * e + 20 * e**2) + spoil * (p == 400) * np.sin(60 * e))
        found.append(drafted(folder))
    first, second = found
    assert first.data["split"] == second.data["split"] == {"validate": {"pressure": [400]}}
    assert [first.spec.get(key) for key in ("dictionary", "model", "segment")] == [
        second.spec.get(key) for key in ("dictionary", "model", "segment")
    ]
    assert first.notes[("target",)].why != second.notes[("target",)].why


def test_with_few_levels_nothing_bends_between_them(tmp_path: Path) -> None:
    """Two training levels cannot tell of a curve across them: levels, a formula, or what is straight across them."""
    table(tmp_path, 3, 60, lambda p, e: p * (2 - 9 * e) + 30 * np.sin(40 * e))
    found = drafted(tmp_path).found
    assert found is not None
    assert {one.family for one in found.tried} <= {"levels", "formula", "surface", "splines"}
    assert [one.words for one in found.tried if one.family == "surface"] == ["surface of order 1, 4 terms"]


def test_a_position_that_follows_slowly_gets_a_memory(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    pressure = 150 + np.convolve(rng.normal(0, 40, 700), np.ones(20) / 6, "same")
    position = np.zeros(700)
    for k in range(1, 700):
        position[k] = position[k - 1] + 0.15 * (0.02 * pressure[k] - position[k - 1])
    position += rng.normal(0, 0.01, 700)
    write(tmp_path / "log.csv", {"t [s]": 0.1 * np.arange(700), "P [kPa]": pressure, "x [mm]": position})
    draft = drafted(tmp_path)
    (tmp_path / "log.yaml").write_text(draft.text())
    assert load(tmp_path / "log.yaml").spec.has_memory
    assert draft.notes[("target",)].sure, draft.notes[("target",)].why
