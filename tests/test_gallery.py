"""Every example of the gallery runs and makes its picture; the site builds, with every link checked."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).resolve().parents[1]
GALLERY = ROOT / "docs" / "gallery"
QUICK = ("first_model", "terms_by_ratio", "delays")
SCRIPTS = [path.stem for path in sorted(GALLERY.glob("*.py")) if path.stem != "muscle"]


@pytest.mark.parametrize("name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in SCRIPTS])
def test_an_example_makes_its_picture(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(GALLERY))
    monkeypatch.setattr(sys, "argv", [name, str(tmp_path / "picture.svg")])
    runpy.run_path(str(GALLERY / f"{name}.py"))
    plt.close("all")
    assert "<svg" in (tmp_path / "picture.svg").read_text()


def test_the_gallery_has_enough() -> None:
    assert len(SCRIPTS) >= 16


@pytest.mark.long
def test_the_site_builds_without_a_broken_link(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-f", "docs/site/mkdocs.yml", "-d", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    assert done.returncode == 0, done.stderr
    for page in ("index.html", "cookbook.html", "python.html", "gallery/index.html", "gallery/bands.html"):
        assert (tmp_path / page).is_file()
