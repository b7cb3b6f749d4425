"""The model that `init` writes: what a search finds on training data, with how it was found, and told where a plainer one is better."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from mapmore_cli.spec.loader import load
from mapmore_cli.study.drafting import start as drafting
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.drafting.guesses import guesses_page
from mapmore_cli.study.drafting.proof import proven

pytestmark = pytest.mark.usefixtures("fewer_families")


def table(folder: Path, levels: int, samples: int, force: Any, header: str = "P [kPa],eps,F [N]") -> None:
    strain = np.linspace(0, 0.15, samples)
    for pressure in 100.0 * np.arange(1, levels + 1):
        rows = np.column_stack(np.broadcast_arrays(pressure, strain, force(pressure, strain)))
        np.savetxt(folder / f"pull_{pressure:g}.csv", rows, delimiter=",", header=header, comments="", fmt="%.7g")


def drafted(folder: Path) -> Draft:
    (draft,) = drafting.start(folder, folder, search=lambda one, place: proven(one, place, 20.0)).drafts
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
    for level in range(1, 8):
        rows = "".join(f"{100 * level},{0.01 * n:.2f},{level * (5 - 0.4 * n):.2f}\n" for n in range(12))
        (tmp_path / f"p_{level}.csv").write_text("pressure_kPa,strain,force_N\n" + rows)
    (draft,) = drafting.start(tmp_path, tmp_path).drafts
    drawn = len(draft.raw["strain"])
    assert drawn < 7
    assert f"made of 7 files, to be checked by eye; {drawn} of them are drawn</p>" in guesses_page(draft)


def test_held_out_levels_do_not_move_the_structure(tmp_path: Path) -> None:
    """What is held out is spoilt: the same structure is found, and the score tells of it."""
    found = []
    for spoil in (0.0, 40.0):
        folder = tmp_path / f"{spoil:g}"
        folder.mkdir()
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


def test_a_long_dictionary_is_wrapped_and_means_the_same() -> None:
    dictionary = [{"terms": [f"tanh((pressure-{k / 100:.2f})/0.05)" for k in range(60)]}]
    draft = Draft({"name": "study", "dictionary": dictionary}).noted(("dictionary",), "why")
    assert yaml.safe_load(draft.text())["dictionary"] == dictionary
    assert max(map(len, draft.text().splitlines())) <= 132


def test_a_position_that_follows_slowly_gets_a_memory(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    pressure = 150 + np.convolve(rng.normal(0, 40, 700), np.ones(20) / 6, "same")
    position = np.zeros(700)
    for k in range(1, 700):
        position[k] = position[k - 1] + 0.15 * (0.02 * pressure[k] - position[k - 1])
    position += rng.normal(0, 0.01, 700)
    rows = np.column_stack([0.1 * np.arange(700), pressure, position])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t [s],P [kPa],x [mm]", comments="", fmt="%.7g")
    draft = drafted(tmp_path)
    (tmp_path / "log.yaml").write_text(draft.text())
    assert load(tmp_path / "log.yaml").spec.has_memory
    assert draft.notes[("target",)].sure, draft.notes[("target",)].why
