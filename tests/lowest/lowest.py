"""The lowest versions of the dependencies, and whether they give the same results.

python tests/lowest/lowest.py requirements          what pip is to install: `>=` of pyproject.toml
as `==`
python tests/lowest/lowest.py run OUT.json          selections and scores of a few studies, with the
libraries of this Python
python tests/lowest/lowest.py compare A.json B.json 1 where a selection differs, or a number by more
than 1e-9
"""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory

PROJECT = Path(__file__).resolve().parents[2]
STUDIES = (
    "m2/dmsp-20-88-static",
    "m2/peano-static",
    "m1/dmsp-20-88-m1-static",
    "wrist/wrist-static",
)
CLOSE = 1e-9
# of nobody who runs the program
TOOLS = (
    "ruff",
    "mypy",
    "import-linter",
    "scipy-stubs",
    "types-",
    "setuptools",
)


def requirements():
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["dev"]]
    return [line.replace(">=", "==") for line in wanted if not line.startswith(TOOLS)]


def results():
    found = {}
    with TemporaryDirectory() as runs:
        for study in STUDIES:
            mapmore("validate", str(PROJECT / "configs" / f"{study}.yaml"), "--runs", runs, "-q")
            folder = Path(runs) / study.rsplit("/", 1)[1]
            fit = json.loads(mapmore("show", str(folder / "fit.h5"), "--json"))
            terms = {segment["id"]: segment["terms"] for segment in fit.get("segments", [])}
            found[study] = {
                "terms": terms,
                "scores": json.loads((folder / "scores.json").read_text())["scores"],
            }
    return found


def mapmore(*arguments):
    call = [sys.executable, "-m", "mapmore_cli", *arguments]
    return subprocess.run(call, check=True, capture_output=True, text=True, cwd=PROJECT).stdout


def leaves(document, where=""):
    """Every value of a document, by its place."""
    if not isinstance(document, dict | list):
        yield where, document
        return
    for key, part in document.items() if isinstance(document, dict) else enumerate(document):
        yield from leaves(part, f"{where}/{key}")


def differences(one, other):
    """Where two documents differ by more than the rounding, and the largest relative difference of
    two numbers.
    """
    ours, theirs, lines, most = dict(leaves(one)), dict(leaves(other)), [], 0.0
    for where in sorted({*ours, *theirs}):
        left, right = ours.get(where), theirs.get(where)
        if isinstance(left, float) and isinstance(right, float):
            far = 0.0 if left == right else abs(left - right) / max(abs(left), abs(right))
            most = max(most, far)
            if far <= CLOSE:
                continue
        if left != right:
            lines.append(f"{where}: {left!r} and {right!r}")
    return lines, most


def main(command, *files):
    match command:
        case "requirements":
            print(*requirements(), sep="\n")
        case "run":
            Path(files[0]).write_text(json.dumps(results()))
        case "compare":
            one, other = (json.loads(Path(file).read_text()) for file in files)
            lines, far = differences(one, other)
            rows = sum(len(study["scores"]) for study in one.values())
            print(
                f"{len(one)} studies, {rows} rows of scores: the largest relative difference "
                f"is {far:.1e}",
                *lines,
                sep="\n",
            )
            return 1 if lines else 0
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
