"""What the project is built of is named by version, by hash and by commit, and fits the Pythons
that the project says it runs on.
"""

import re
import tomllib
from importlib.metadata import distributions
from itertools import chain
from pathlib import Path
from sysconfig import get_path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PINS = {
    canonicalize_name(name): version
    for name, version in re.findall(
        r"^([\w.-]+)==(\S+)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE
    )
}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_every_version_has_its_hashes():
    text = (ROOT / "requirements-hashed.txt").read_text()
    entries = re.findall(
        r"^([\w.-]+)==([^\s;]+)[^\n]*\\\n((?: +--hash=\S+(?: \\)?\n)+)", text, re.M
    )
    assert {canonicalize_name(name): version for name, version, _ in entries} == PINS
    assert len(entries) == len(PINS)
    hashes = [one for _, _, lines in entries for one in lines.replace("\\", "").split()]
    assert all(re.fullmatch(r"--hash=sha256:[0-9a-f]{64}", one) for one in hashes)
    assert "://" not in text


def test_what_the_project_needs_is_pinned_within_its_limits():
    needed = [*PROJECT["dependencies"], *chain(*PROJECT["optional-dependencies"].values())]
    for requirement in map(Requirement, needed):
        assert requirement.specifier.contains(PINS[canonicalize_name(requirement.name)])


@pytest.mark.parametrize("python", ["3.11.0", "3.11.2", "3.12.0", "3.13.0"])
def test_every_pin_allows_the_pythons_that_the_project_names(python):
    """Debian's own Python is 3.11.2: a pin that needs a later one ends the set-up after minutes."""
    assert SpecifierSet(PROJECT["requires-python"]).contains(python)
    refused = [
        (one.name, one.metadata["Requires-Python"])
        for one in distributions(path=[get_path("purelib")])
        if PINS.get(canonicalize_name(one.name)) == one.version
        and not SpecifierSet(one.metadata.get("Requires-Python") or "").contains(python)
    ]
    assert refused == []


def test_actions_are_pinned_by_commit_and_store_no_secret():
    for path in (ROOT / ".github/workflows/ci.yml", ROOT / "docs/examples/ci.yaml"):
        text = path.read_text()
        workflow = yaml.safe_load(text)
        steps = [step for job in workflow["jobs"].values() for step in job["steps"]]
        used = [step["uses"] for step in steps if "uses" in step]
        assert used
        assert all(re.fullmatch(r"[\w/-]+@[0-9a-f]{40}", one) for one in used)
        assert workflow["permissions"] == {"contents": "read"}
        assert "secrets." not in text
    jobs = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"]
    assert {"make test PYTHON=python"} == {
        step["run"] for step in jobs["test"]["steps"] if "run" in step
    }
    assert len(jobs["test"]["strategy"]["matrix"]["os"]) == 2
    assert len(jobs["test"]["strategy"]["matrix"]["python"]) == 3


def test_no_variable_of_the_makefile_ends_with_blanks():
    """Make keeps the blanks between a value and a comment: a path with them leads nowhere."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.findall(r"^[^#\t\n]*:?=[^#\n]*[ \t]+#.*$|^[^\t\n]*:?=.*[ \t]$", makefile, re.M) == []
