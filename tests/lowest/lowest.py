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
import math
import subprocess
import sys
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

PROJECT = Path(__file__).resolve().parents[2]
STUDIES = (
    "m2/dmsp-20-88-static",
    "m2/peano-static",
    "m1/dmsp-20-88-m1-static",
    "wrist/wrist-static",
)
CLOSE = 1e-9
TOOLS = (
    "ruff",
    "mypy",
    "import-linter",
    "scipy-stubs",
    "types-",
    "setuptools",
)  # of nobody who runs the program


def requirements() -> list[str]:
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["dev"]]
    return [line.replace(">=", "==") for line in wanted if not line.startswith(TOOLS)]


def results() -> dict[str, Any]:
    found: dict[str, Any] = {}
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


def mapmore(*arguments: str) -> str:
    call = [sys.executable, "-m", "mapmore_cli", *arguments]
    return subprocess.run(call, check=True, capture_output=True, text=True, cwd=PROJECT).stdout


def differences(one: Any, other: Any, where: str = "") -> tuple[list[str], float]:
    """Where two documents differ by more than the rounding, and the largest relative difference of
    two numbers.
    """
    if isinstance(one, float) and isinstance(other, float):
        far = 0.0 if one == other else abs(one - other) / max(abs(one), abs(other))
        return (
            [f"{where}: {one!r} and {other!r}"]
            if not math.isclose(one, other, rel_tol=CLOSE, abs_tol=0)
            else []
        ), far
    if isinstance(one, dict | list) and type(one) is type(other) and len(one) == len(other):
        keys = one if isinstance(one, dict) else range(len(one))
        if isinstance(one, dict) and {*one} != {*other}:
            return [f"{where}: {sorted(one)} and {sorted(other)}"], 0.0
        found = [differences(one[key], other[key], f"{where}/{key}") for key in keys]
        return [line for lines, _ in found for line in lines], max(
            (far for _, far in found), default=0.0
        )
    return ([] if one == other else [f"{where}: {one!r} and {other!r}"]), 0.0


def main(command: str, *files: str) -> int:
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
