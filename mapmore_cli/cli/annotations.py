"""Print messages as workflow commands of GitHub Actions. GitHub then shows each message beside the
line of the file to which it refers.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

from mapmore_cli.domain.foreign import printable

Kind = Literal["error", "warning", "notice"]

_PLACED = re.compile(r"(?P<file>[^:\n]+):(?:row )?(?P<line>\d+)(?::(?P<col>\d+))?(?=[:, ])")
_ESCAPES = {"%": "%25", "\r": "%0D", "\n": "%0A"}
_PROPERTY_ESCAPES = {**_ESCAPES, ":": "%3A", ",": "%2C"}


def annotate(kind: Kind, text: str) -> None:
    """Print a message as annotations on stderr if the command runs in GitHub Actions."""
    if os.environ.get("GITHUB_ACTIONS") == "true":
        for line in workflow_commands(kind, text):
            print(printable(line), file=sys.stderr)


def workflow_commands(kind: Kind, text: str) -> Iterator[str]:
    """Yield an annotation (a workflow command of GitHub Actions) for each mistake in a message. The
    indented lines below a mistake belong to the mistake.

    A mistake that begins with a position in an existing file (`spec.yaml:17:3`, `a.csv:row 17`)
    gets the properties `file`, `line` and `col`. The path in `file` is relative to the root of the
    checkout: the folder in `GITHUB_WORKSPACE`, otherwise the current folder.
    """
    root = os.environ.get("GITHUB_WORKSPACE") or "."
    for mistake in re.split(r"\n+(?=\S)", text):
        place = _PLACED.match(mistake)
        properties: dict[str, str] = {}
        if place is not None and Path(place["file"]).is_file():
            path = Path(os.path.relpath(place["file"], root)).as_posix()
            properties = {"file": path, "line": place["line"]}
            if place["col"]:
                properties["col"] = place["col"]
        written = ",".join(
            f"{key}={_escaped(value, _PROPERTY_ESCAPES)}" for key, value in properties.items()
        )
        yield f"::{kind}{' ' if written else ''}{written}::{_escaped(mistake.rstrip(), _ESCAPES)}"


def _escaped(text: str, escapes: Mapping[str, str]) -> str:
    return "".join(escapes.get(letter, letter) for letter in text)
