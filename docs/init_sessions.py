"""Sessions of `mapmore init` at a pseudo-terminal, as the terminal showed them but for colours and
bars that vanish: docs/sessions/*.txt.

`python docs/init_sessions.py [FOLDER ...]` answers the questions about folders in `MAPMORE_DATA`
(by default `../shared/data`), checks the spec, and writes the files.
"""

from __future__ import annotations

import json
import os
import pty
import re
import select
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from drafted_tables import data_folder

SESSIONS = Path(__file__).parent / "sessions"
QUESTION = " > "
PATIENCE = 900.0  # s
WIDTH = "140"
SAID: Mapping[str, tuple[str, ...]] = {
    "printed_cylinder": ("force=6:N", "displacement=4:mm,pressure=5:bar,time=0:ms"),
    "single_bellows": (),
    "textile_arm": ("x=14:m", "pressure=4:psi,time=0:s", "last"),
    "bender": ("angle=11:deg", "p1=1:mbar,p2=3:mbar,time=0:s"),
}
"""What a person who knows the rig answers, in turn; Enter where the answers have run out."""
ON_THE_LINE: Mapping[str, tuple[str, ...]] = {
    "single_bellows": ("--columns", "pressure=Pressure:psi")
}
"""What the person says with the command: nothing asks for the unit of a second log."""


def session(folder: Path, data: Path, answers: Sequence[str], *more: str) -> tuple[str, int, int]:
    """Return what the terminal showed, how many questions there were, and the exit code."""
    ours, theirs = pty.openpty()
    command = [
        sys.executable,
        "-m",
        "mapmore_cli",
        "init",
        str(data),
        "--name",
        "asked",
        "-o",
        "asked.yaml",
        *more,
    ]
    process = subprocess.Popen(
        command,
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        cwd=folder,
        env={**os.environ, "COLUMNS": WIDTH},
    )
    os.close(theirs)
    shown, asked, begin = "", 0, time.monotonic()
    while time.monotonic() - begin < PATIENCE:
        if not select.select([ours], [], [], 0.2)[0]:
            if process.poll() is not None:
                break
            continue
        try:
            text = os.read(ours, 65536).decode(errors="replace")
        except OSError:  # the other end is closed
            break
        shown += text
        if shown.endswith(QUESTION):
            reply = answers[asked] if asked < len(answers) else ""
            asked += 1
            os.write(ours, f"{reply}\n".encode())
    os.close(ours)
    return shown, asked, process.wait(10)


def as_text(shown: str) -> str:
    """Return what stays on the screen: without colours, and without the bars that vanish."""
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown).replace("\r\n", "\n")
    lines = [line.rpartition("\r")[2].rstrip() for line in plain.split("\n")]
    return "\n".join(line for line in lines if "\u2501" not in line).strip("\n")


def transcript(name: str, folder: Path) -> str:
    """Return what the check of its spec says, and the session about a folder."""
    with TemporaryDirectory() as place:
        there = Path(place)
        (there / name).symlink_to(folder)
        options = ON_THE_LINE.get(name, ())
        shown, asked, code = session(there, Path(name), SAID[name], *options)
        if code:
            raise RuntimeError(shown)
        command = [sys.executable, "-m", "mapmore_cli", "check", "asked.yaml", "--json", "-q"]
        done = subprocess.run(command, cwd=there, capture_output=True, text=True, check=True)
        result = json.loads(done.stdout)
    issues, open_ = len(result["issues"]), len(result["unconfirmed"])
    answered = f"{asked} answer{'s' if asked != 1 else ''}"
    found = f"{issues} issue{'s' if issues != 1 else ''}"
    told = f"{answered}; check: {found}, {open_} open question{'s' if open_ != 1 else ''}."
    line = " ".join(["mapmore init", name, "--name asked -o asked.yaml", *options])
    return f"{told}\n\n$ {line}\n{as_text(shown)}\n"


if __name__ == "__main__":
    for name in sys.argv[1:] or SAID:
        (SESSIONS / f"{name}.txt").write_text(
            transcript(name, data_folder() / name), encoding="utf-8"
        )
