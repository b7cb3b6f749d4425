"""Every example of the gallery runs and makes its picture; the site builds, with every link
checked.
"""

import importlib
import json
import re
import runpy
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest
from common import process

from mapmore_cli.api import Fitted

ROOT = Path(__file__).resolve().parents[1]
GALLERY = ROOT / "docs" / "gallery"
QUICK = ("first_model", "terms_by_ratio", "delays")
SCRIPTS = [path.stem for path in sorted(GALLERY.glob("*.py")) if path.stem != "muscle"]


def held_out(scores):
    """Errors on the held-out data by model, pooled."""
    return {
        row["model"]: row["nrmse"]
        for row in scores
        if (row["split"], row["curve"]) == ("validate", "all")
    }


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in SCRIPTS],
)
def test_an_example_makes_its_picture(name, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(GALLERY))
    monkeypatch.setattr(sys, "argv", [name, str(tmp_path / "picture.svg")])
    made = runpy.run_path(str(GALLERY / f"{name}.py"))
    plt.close("all")
    now, kept = (path.read_text() for path in (tmp_path / "picture.svg", GALLERY / f"{name}.svg"))
    assert words(now) == words(kept), "run `make generated`"
    for model in made.values():
        if isinstance(model, Fitted):
            errors = held_out(model.scores)
            assert not errors or errors["mapmore"] == min(errors.values())


def words(svg):
    """The texts of a picture: titles, legends and ticks, which change when its numbers do."""
    return re.findall(r"<!-- (.+?) -->", svg)


def test_the_notebook_goes_from_a_frame_to_an_exported_table(
    monkeypatch,
):
    """Every cell runs, and the table that it reads back is the model on the held-out recording, but
    for the grid.
    """
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    notebook = importlib.import_module("notebook")
    nbformat.validate(nbformat.read(notebook.NOTEBOOK, as_version=4))
    cells, names = notebook.executed()
    kept = json.loads(notebook.NOTEBOOK.read_text("utf-8"))["cells"]
    assert [answers(cell) for cell in cells] == [answers(cell) for cell in kept]
    assert names["within"].mean() > 0.5
    assert 0 < names["difference"] < 0.005 * np.ptp(names["predicted"])
    by_model = held_out(names["model"].scores)
    assert by_model["mapmore"] == min(by_model.values()) < 0.015


def answers(cell):
    """The texts that a cell printed or answered with."""
    return [
        output.get("data", {"text/plain": output.get("text")}).get("text/plain")
        for output in cell.get("outputs", [])
    ]


def test_the_gallery_has_enough():
    assert len(SCRIPTS) >= 16


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the site, built with every link checked."""
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    command = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "-q",
        "-f",
        "docs/site/mkdocs.yml",
        "-d",
        str(folder),
    ]
    done = process(*command, cwd=ROOT, env={"NO_MKDOCS_2_WARNING": "1"})
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.long
def test_the_site_has_its_pages_and_every_local_link_its_target(site):
    for page in (
        "index",
        "notebook",
        "python",
        "commands",
        "gallery/index",
        "gallery/bands",
    ):
        assert (site / f"{page}.html").is_file()
    for page in site.rglob("*.html"):
        for target in re.findall(
            r'(?:href|src)="([^"#:?]+)[^":]*"', page.read_text(encoding="utf-8")
        ):
            assert page.name == "404.html" or (page.parent / target).exists(), (page.name, target)


@pytest.mark.long
@pytest.mark.parametrize(
    ("word", "page"),
    [
        ("overfit", "how-good"),
        ("excel", "data"),
        ("arduino", "export-c"),
        ("reproduc", "reproduce"),
        ("cite", "cite"),
        ("limit", "limits"),
    ],
)
def test_the_search_finds_a_page_by_its_word(word, page, site):
    """The index of the site's search has the stem of a word (overfitting, limitations), for which
    the search looks, on the page that is about it.
    """
    index = json.loads((site / "search" / "search_index.json").read_text("utf-8"))
    found = {
        entry["location"].partition(".html")[0]
        for entry in index["docs"]
        if re.search(rf"\b{word}", f"{entry['title']} {entry['text']}", re.IGNORECASE)
    }
    assert page in found
