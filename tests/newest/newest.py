"""The newest Python on the machine with the newest libraries: the tests of `make test-lowest`, and
a study of each kind.

python tests/newest/newest.py PYTHON TEST...   PYTHON is a name or a path; empty for the newest of
NAMES

Where there is no such Python it says so, and ends with 0. The environment takes no constraints. A
warning that something will go away is an error: it is the failure of the next version.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

PROJECT = Path(__file__).resolve().parents[2]
ENVIRONMENT = PROJECT / ".venv-newest"
NAMES = ("python3.13", "python3.12")
STUDIES = {
    "static pieces": "m2/dmsp-20-88-static",
    "damping": "m2/dmsp-20-88-damping",
    "dynamic, a sum": "m2/dmsp-20-88-dynamic",
    "hysteresis": "m1/dmsp-20-88-m1-hysteresis",
    "memory": "m1/dmsp-20-88-inner-reversals",
    "formula": "muscle-like/muscle-like-16cm-formula",
    "motion": "motion/dmsp-20-400-loads",
}
STRICT = [
    f"-Werror::{kind}"
    for kind in ("DeprecationWarning", "PendingDeprecationWarning", "FutureWarning")
]


def places(name):
    """Where a Python of this name may be: itself, on the path (a shim of pyenv's may not be
    active), and in pyenv's own folder.
    """
    found = shutil.which(name)
    if found is not None:
        yield Path(found)
    root = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
    versions = root.glob(f"versions/{name.removeprefix('python')}*/bin/python")
    yield from sorted(
        versions,
        key=lambda path: [int(part) for part in re.findall(r"\d+", path.parts[-3])],
        reverse=True,
    )


def starts(python):
    """Whether it starts and can make an environment."""
    return (
        subprocess.run(
            [python, "-c", "import ensurepip, venv"], capture_output=True, check=False
        ).returncode
        == 0
    )


def made(python):
    """The Python of an environment with the newest libraries; it is made anew where it has another
    Python, or is older than the project.
    """
    own, stamp = ENVIRONMENT / "bin" / "python", ENVIRONMENT / "made"
    version = subprocess.run([python, "-VV"], capture_output=True, text=True, check=True).stdout
    if (
        stamp.exists()
        and stamp.read_text() == version
        and stamp.stat().st_mtime > (PROJECT / "pyproject.toml").stat().st_mtime
    ):
        return own
    subprocess.run([python, "-m", "venv", "--clear", ENVIRONMENT], check=True)
    subprocess.run(
        [
            own,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "-e",
            f"{PROJECT}[dev]",
        ],
        check=True,
    )
    stamp.write_text(version)
    return own


def run_studies(python):
    with TemporaryDirectory() as folder:
        runs = ["--runs", f"{folder}/runs", "-q"]

        def mapmore(*arguments):
            print("mapmore", *arguments, flush=True)
            subprocess.run(
                [python, *STRICT, "-m", "mapmore_cli", *map(str, arguments)],
                check=True,
                cwd=PROJECT,
                stdout=subprocess.DEVNULL,
            )

        mapmore("example", f"{folder}/example", "-q")
        for study in (
            f"{folder}/example/study.yaml",
            *(PROJECT / "configs" / f"{study}.yaml" for study in STUDIES.values()),
        ):
            mapmore("run", study, *runs)


def main(wanted, *tests):
    names = [wanted] if wanted else NAMES
    found = next((place for name in names for place in places(name) if starts(place)), None)
    if found is None:
        print(f"there is no {' and no '.join(names)} here: the newest libraries are not tested")
        return 0
    python = made(found)
    shown = (
        "import sys, numpy; print('Python', sys.version.split()[0], 'with NumPy', "
        "numpy.__version__)"
    )
    subprocess.run([python, "-c", shown], check=True)
    subprocess.run(
        [python, "-m", "pytest", "-q", "-n", "2", "--dist", "loadfile", *tests],
        check=True,
        cwd=PROJECT,
    )
    run_studies(python)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(*sys.argv[1:]))
    except subprocess.CalledProcessError as fault:
        sys.exit(f"{' '.join(map(str, fault.cmd))[:200]} ended with {fault.returncode}")
