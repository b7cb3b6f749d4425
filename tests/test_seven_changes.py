"""Ordinary changes cost one file of the package each: what is added is declared once, and one that
is half made fails at the import or in a test of its room.

Each file in `tests/changes/` is a change: a `PATCH` of files of the package (a whole new text, or
what is replaced by what), code that `WORKS` only with it, and `HALVES` of it, with what notices.
"""

import os
import sys
from importlib import import_module
from pathlib import Path

import pytest
from common import process

PROJECT = Path(__file__).resolve().parents[1]
CHANGES = {
    path.stem: import_module(f"changes.{path.stem}")
    for path in sorted((PROJECT / "tests/changes").glob("*.py"))
}
HALVES = [
    pytest.param(*half, id=f"{name} {words}")
    for name, change in CHANGES.items()
    for words, half in change.HALVES.items()
]
HEAD = "from pathlib import Path\nimport numpy as np\n"


def patched(folder, *patches):
    """A copy of the package, of links, in which some files are changed or added."""
    for path in sorted((PROJECT / "mapmore_cli").rglob("*")):
        if path.is_file():  # with what Python has compiled
            copy = folder / path.relative_to(PROJECT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.symlink_to(path)
    for file, edits in (edit for patch in patches for edit in patch.items()):
        path = folder / "mapmore_cli" / file
        text = edits if isinstance(edits, str) else path.read_text(encoding="utf-8")
        for old, new in () if isinstance(edits, str) else edits:
            assert text.count(old) == 1, f"{file} has other lines than the change expects: {old}"
            text = text.replace(old, new)
        path.unlink(missing_ok=True)
        path.write_text(text, encoding="utf-8")
    return {"PYTHONPATH": os.pathsep.join([str(folder), str(PROJECT / "tests")])}


def run(env, *arguments, cwd):
    return process(sys.executable, "-P", *arguments, env=env, cwd=cwd, timeout=200)


def test_a_change_is_made_in_one_file_and_works(tmp_path):
    """All of them in one copy: two files at most, and hardly more than one on average."""
    counts = {name: len(change.PATCH) for name, change in CHANGES.items()}
    assert max(counts.values()) <= 2
    mean = sum(counts.values()) / len(counts)
    assert mean <= 1.3, counts
    assert f"{mean:.2f} files on average" in (PROJECT / "docs/design.md").read_text()
    env = patched(tmp_path, *(change.PATCH for change in CHANGES.values()))
    code = "".join(change.WORKS for change in CHANGES.values())
    done = run(env, "-c", HEAD + code, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
@pytest.mark.parametrize(("patch", "notices"), HALVES)
def test_half_of_a_change_is_noticed(patch, notices, tmp_path):
    env = patched(tmp_path, patch)
    if notices == "an import":
        done = run(env, "-c", "import mapmore_cli.study.loader", cwd=tmp_path)
        assert "Error" in done.stderr
    else:
        paths = f"pythonpath={tmp_path} tests docs tests/exporting tests/modelling/pieces"
        test = str(PROJECT / "tests" / notices)
        done = run(env, "-m", "pytest", "-x", "-q", "-o", paths, "-p", "no:cacheprovider", test,
            cwd=PROJECT)  # fmt: skip
        assert "1 failed" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 1
