"""Where an array stands inside a file: `run.P`, `train[3].y[:,0]`, `group/dataset`."""

from __future__ import annotations

import re
from dataclasses import dataclass

from mapmore_cli.domain.errors import DataError

Selection = tuple[int | slice, ...]
"""An index in brackets, `:` being a whole axis."""

EVERY = "[*]"
_STEP = re.compile(r"(?P<separator>[./]?)(?:(?P<name>[^./\[\]]+)|\[(?P<index>[^\[\]]*)\])")


@dataclass(frozen=True)
class Address:
    """Steps from the top of a file: names of members, and selections of elements; `text` is how the spec spells it."""

    text: str
    steps: tuple[str | Selection, ...]


def parse_address(text: str) -> Address:
    """Return the steps of an address: names after `.` or `/`, and 0-based indices in brackets. Raises DataError."""
    steps: list[str | Selection] = []
    position = 0
    while position < len(text):
        step = _STEP.match(text, position)
        if step is None or (step["separator"] and step["name"] is None):
            raise DataError(f"'{text}' is no address", "Write names and 0-based indices, as `run.P`, `train[3].y[:,0]` or `group/dataset`.")
        steps.append(step["name"].strip() if step["name"] is not None else _selection(step["index"], text))
        position = step.end()
    return Address(text, tuple(steps))


def _selection(inside: str, text: str) -> Selection:
    def one(part: str) -> int | slice:
        if part == ":":
            return slice(None)
        if re.fullmatch(r"\d+", part):
            return int(part)
        raise DataError(f"'{text}': '[{inside}]' is no index", "Write 0-based numbers and `:`, as `y[:,0]`; only `root` may end in `[*]`.")

    return tuple(one(part.strip()) for part in inside.split(","))
