"""The program as somebody gets it who has no checkout: a wheel, built and tried."""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile

import common
import pytest
from cli_samples import PROJECT
from common import NO_NETWORK

BUILD = (
    "import sys; from setuptools import build_meta; getattr(build_meta, sys.argv[1])(sys.argv[2])"
)
"""What pip has the build backend do, without pip."""


REPOSITORY = "https://forge.example/somebody/mapmore"


def build(place, *work):
    command = [sys.executable, "-c", BUILD, *work]
    environment = {**os.environ, "MAPMORE_REPOSITORY": REPOSITORY}
    subprocess.run(command, check=True, cwd=place, capture_output=True, env=environment)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built from the archive of the sources, as an index would hand it out."""
    folder = tmp_path_factory.mktemp("wheel")
    copy = folder / "copy"  # a build leaves folders where it works
    wanted = shutil.ignore_patterns(
        ".*", "tests", "docs", "configs", "datasets", "runs", "build", "*.egg-info", "__pycache__"
    )
    shutil.copytree(PROJECT, copy, ignore=wanted)
    build(copy, "build_sdist", folder)
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as sources:
        sources.extractall(folder, filter="data")
    build(folder / archive.name.removesuffix(".tar.gz"), "build_wheel", folder)
    (found,) = folder.glob("*.whl")
    return found


def test_the_wheel_holds_every_module_and_file(wheel):
    ours = {
        path.relative_to(PROJECT).as_posix()
        for path in (PROJECT / "mapmore_cli").rglob("*")
        if path.is_file()
    }
    ours = {name for name in ours if "__pycache__" not in name}
    assert ours <= set(zipfile.ZipFile(wheel).namelist())


def test_an_index_shows_a_description_whose_links_lead_to_the_repository(wheel):
    archive = zipfile.ZipFile(wheel)
    (name,) = (name for name in archive.namelist() if name.endswith("/METADATA"))
    text = archive.read(name).decode()
    assert "Description-Content-Type: text/markdown" in text
    targets = re.findall(r"\]\(([^)]+)\)", text)
    assert f"{REPOSITORY}/raw/main/docs/figures/annotated-page.svg" in targets
    assert all(target.startswith(REPOSITORY) for target in targets)


def test_an_installed_program_makes_its_example_and_a_draft(wheel, tmp_path):
    """From the wheel alone, far from the checkout, and without a network: whoever opens a
    connection ends with an internal fault.
    """
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    (tmp_path / "site" / "sitecustomize.py").write_text(NO_NETWORK)
    env = {"PYTHONPATH": str(tmp_path / "site")}
    probe = common.python("import socket; socket.socket().connect(('127.0.0.1', 9))", env=env)
    assert "RuntimeError: socket.connect" in probe.stderr

    def mapmore(*arguments):
        return common.mapmore(*arguments, check=True, env=env, cwd=tmp_path).stdout

    mapmore("example", "muscle", "-q")
    document = json.loads(
        mapmore("run", "muscle/study.yaml", "--json", "-q", "--set", "report.figures=[fit]")
    )
    assert document["stages"]["report"] == "done"
    assert (tmp_path / "runs" / "muscle" / "report" / "index.html").is_file()
    mapmore("init", "muscle", "--like", "m2", "--name", "mine", "-o", "mine.yaml", "-q")
