"""Run the sessions that pages show, and compare what they show with what is printed.

A session is every block of a page that begins with ```` ```console ````. A line that begins with
`$ ` is a command; the lines below it are lines of its output, in their order. A line `...` stands
for lines that are left out, ` ...` at the end of a line for the rest of the line, and several
spaces count as one. A block whose first line is `# folder/name.yaml` (or `.py`, `.csv`) is written
to that path before the commands that follow it are run.
"""

import difflib
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
NAMED = re.compile(r"(?:#|//) ([\w./-]+\.(?:yaml|py|csv|ino|c|mo))\n")
PIPE = re.compile(r"(?:(?P<before>[^|]+)\| )?mapmore (?P<words>[^|>]+)")
WRITE = "MAPMORE_WRITE_DOCS"


@dataclass(frozen=True)
class Call:
    """A command of a session: its text, the shown lines, and the place of these in the page."""

    command: str
    shown: tuple[str, ...]
    place: tuple[int, int]


def steps_of(text):
    """Yield the files and commands of a page from top to bottom: `(path, content)` or a `Call`."""
    for fence in FENCE.finditer(text):
        language, block = fence.groups()
        if language == "console":
            yield from calls_of(block, fence.start(2))
        elif named := NAMED.match(block):
            yield named[1], block


def calls_of(block, start):
    """Yield the commands of one block; a command goes on after a backslash at the end of a line."""
    for part in re.finditer(
        r"^\$ (?P<command>(?:.*\\\n)*.*)\n(?P<shown>(?:(?!\$ ).*\n)*)", block, re.M
    ):
        place = (start + part.start("shown"), start + part.end("shown"))
        command = part["command"].replace("\\\n", " ")
        yield Call(command, tuple(part["shown"].splitlines()), place)


def printed_by(command, mapmore):
    """Run one command of a shell and return the lines that it prints.

    `mapmore ...` and `SOMETHING | mapmore ...` run in this process, which saves the start of
    another.
    """
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    simple = PIPE.fullmatch(command)
    stdin = None
    if simple is None or simple["before"]:
        shell = command if simple is None else simple["before"]
        done = subprocess.run(
            ["bash", "-c", shell], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{shell}: {done.stderr}"
        if simple is None:
            return (done.stdout + done.stderr).splitlines()
        stdin = done.stdout
    return mapmore(*words_of(simple["words"]), stdin=stdin, code=0).output.splitlines()


def words_of(text):
    """Split a command into its arguments; a run draws one figure only, which is faster."""
    import shlex

    words = shlex.split(text, comments=True)
    return words + ["--set", "report.figures=[fit]"] * (words[0] == "run")


def difference(shown, printed):
    """Return the shown lines that are not printed, in their order, with the line most like each."""
    rest, wrong = list(printed), {}
    for line in shown:
        if line.strip() in ("", "..."):
            continue
        at = next((k for k, one in enumerate(rest) if is_same(line, one)), None)
        if at is None:
            (wrong[line],) = difflib.get_close_matches(line, rest, 1, 0) or [""]
        else:
            del rest[: at + 1]
    return wrong


def is_same(shown, printed):
    """Return True if a shown line is the printed one, apart from the width of its gaps."""
    shown, printed = (" ".join(line.split()) for line in (shown, printed))
    if shown.endswith(" ..."):
        return printed.startswith(shown.removesuffix(" ..."))
    return shown == printed


def run_page(path, mapmore):
    """Run the sessions of a page in the current folder; fail if it shows what is not printed.

    With `MAPMORE_WRITE_DOCS=1` in the environment the lines are corrected in the page instead.
    """
    text = path.read_text(encoding="utf-8")
    corrected, faults = text, []
    for step in steps_of(text):
        if not isinstance(step, Call):
            name, content = step
            Path(name).parent.mkdir(parents=True, exist_ok=True)
            Path(name).write_text(content, encoding="utf-8")
            continue
        wrong = difference(step.shown, printed_by(step.command, mapmore))
        faults += [f"$ {step.command}\n  shown:   {a}\n  printed: {b}" for a, b in wrong.items()]
        block = text[slice(*step.place)]
        for line, printed in wrong.items():
            corrected = corrected.replace(block, block.replace(line, printed.rstrip()))
            block = block.replace(line, printed.rstrip())
    if os.environ.get(WRITE):
        path.write_text(corrected, encoding="utf-8")
    else:
        assert not faults, f"{path.name} ({WRITE}=1 corrects the page):\n" + "\n".join(faults)
