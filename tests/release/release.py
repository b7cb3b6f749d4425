"""What a release has to pass: `make release-check`.

The sources of a fresh clone are built into an archive and a wheel without a network, and twine
looks at both. Then five visitors come, to the clone and to the wheel alone, far from any checkout,
on each Python that is here. A command that does not end with 0, or a file that it should leave and
does not, ends the check.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tarfile
from pathlib import Path
from tempfile import TemporaryDirectory

PROJECT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(PROJECT / "tests"), str(PROJECT / "tests" / "newest")]
from common import BUILD, NO_NETWORK  # noqa: E402
from newest import places, starts  # noqa: E402

PYTHONS = ("python3.11", "python3.12", "python3.13")
VISITORS = {
    "student": """
        mapmore example muscle
        mapmore check muscle/study.yaml
        mapmore run muscle/study.yaml
        mapmore show runs/example/model.h5
        mapmore run muscle/search.yaml
        mapmore init muscle --name mine -o mine.yaml --yes
        mapmore run mine.yaml
    """,
    "controls engineer": """
        mapmore export runs/example/model.h5 --to c -o controller
        mapmore export runs/example/model.h5 --to py -o controller
        mapmore export runs/example/model.h5 --to table -o tables
        mapmore predict runs/example/model.h5 --grid pressure=80:500:140,strain=0:0.1:0.05 -o t.csv
    """,
    "CI engineer": """
        mapmore run muscle/study.yaml --json --quiet --junit junit.xml --summary summary.md
        mapmore freeze example --tag spring
        mapmore compare spring example --fail-on 0.03
        mapmore batch muscle/study.yaml muscle/search.yaml
    """,
    "reviewer": """
        mapmore paper muscle/paper.yaml
        mapmore figure example fit --curve 350 -o fig.pdf --data fig.csv
        mapmore tune muscle/study.yaml --over segment.strain.count=2,4
    """,
    "notebook": """
        python -c "import mapmore_cli as mm; m = mm.load_model('runs/example/model.h5');
        assert m(pressure=200, strain=0.05) > 0;
        assert mm.run('muscle/study.yaml').scores"
    """,
}
"""Who comes, and what they type, one after the other in one folder."""

LEFT = (
    *("runs/example/report/index.html", "runs/example-search/found.yaml", "runs/paper.html"),
    *("controller/example.c", "controller/example.py", "tables/example.mat", "junit.xml"),
    *("summary.md", "fig.pdf"),
)


def call(*command: str | Path, folder: Path, **variables: str) -> None:
    """Run a command; its output is shown where it fails."""
    print("+", shlex.join(map(str, command))[:110], flush=True)
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **variables},
    )
    if done.returncode:
        sys.exit(f"{done.stdout}\n{done.stderr}\nended with {done.returncode}")


def built(clone: Path, offline: Path) -> Path:
    """Build the archive of a clone, and from it the wheel; return the wheel."""
    folder = clone.parent / "dist"
    folder.mkdir()
    alone = {"PYTHONPATH": str(offline)}
    call(sys.executable, "-c", BUILD, "build_sdist", folder, folder=clone, **alone)
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as sources:
        sources.extractall(clone.parent, filter="data")
    sources_of = clone.parent / archive.name.removesuffix(".tar.gz")
    call(sys.executable, "-c", BUILD, "build_wheel", folder, folder=sources_of, **alone)
    (wheel,) = folder.glob("*.whl")
    call(sys.executable, "-m", "twine", "check", "--strict", archive, wheel, folder=folder)
    return wheel


def visited(programs: Path, folder: Path, offline: Path) -> None:
    """Let every visitor type in an empty folder, without a network."""
    folder.mkdir()
    variables = {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(offline)}
    for visitor, typed in VISITORS.items():
        print(f"{visitor}:", flush=True)
        lexer = typed.replace(";\n", ";").strip().splitlines()
        for line in lexer:
            name, *rest = shlex.split(line)
            call(programs / name, *rest, folder=folder, **variables)
    missing = [name for name in LEFT if not (folder / name).is_file()]
    if missing:
        sys.exit(f"not made: {', '.join(missing)}")


def main(*wanted: str) -> None:
    """Check a release on the named Pythons, or on those of PYTHONS that are here."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        clone, offline = folder / "clone", folder / "offline"
        offline.mkdir()
        (offline / "sitecustomize.py").write_text(NO_NETWORK)
        call("git", "clone", "--quiet", PROJECT, clone, folder=folder)
        wheel = built(clone, offline)
        for version in wanted or PYTHONS:
            python = next((place for place in places(version) if starts(place)), None)
            if python is None:
                print(f"there is no {version} here: left out")
                continue
            programs = folder / version / "bin"
            call(python, "-m", "venv", folder / version, folder=folder)
            install = ("-m", "pip", "install", "--quiet", wheel)
            call(programs / "python", *install, folder=folder)
            visited(programs, folder / f"visit-{version}", offline)
        call("make", "demo", f"PYTHON={sys.executable}", folder=clone)
        visited(clone / ".venv" / "bin", folder / "visit-clone", offline)
    print("the release passes")


if __name__ == "__main__":
    main(*sys.argv[1:])
