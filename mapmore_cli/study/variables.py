"""Expand references to environment variables in the texts of a spec: `${NAME}` and
`${NAME:-default}`.
"""

from __future__ import annotations

import os
import re
from typing import TypeVar, cast

V = TypeVar("V")

READABLE = "MAPMORE_"
"""Prefix of the environment variables that any spec may read. The prefix protects all others: a
spec from a stranger must not be able to read a password.
"""

MORE = "MAPMORE_ENV"
"""Name of the variable that lists further variables, separated by commas. `--env` adds to it, so
that worker processes know them too.
"""

VARIABLES = "set it, give a default as `${NAME:-default}`, or write `$${` for a plain `${`"
"""Remedy in the message about a variable that cannot be expanded."""

_REFERENCE = re.compile(r"\$\$\{|\$\{([^{}]*)(\}?)")

_BODY = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)(:-(.*))?", re.DOTALL)


def expand(text: str) -> str:
    """Return the text with every reference replaced; `$${` becomes `${`.

    As in a shell, the default after `:-` replaces an unset or empty variable.

    Raises ValueError for a variable that is not set and has no default, a variable that no spec may
    read, and a malformed reference.
    """
    return _REFERENCE.sub(_variable_value, text)


def readable_variables() -> dict[str, str]:
    """Return the environment variables that specs may read, with their values."""
    more = os.environ.get(MORE, "").split(",")
    return {
        name: value
        for name, value in os.environ.items()
        if name.startswith(READABLE) or name in more
    }


def variable_in(text: str) -> str | None:
    """Return the first reference to a variable in a text, for example `${DATA}`. Return None if the
    text contains no reference.
    """
    return next((match[0] for match in _REFERENCE.finditer(text) if match[0] != "$${"), None)


def escaped(value: V) -> V:
    """Return a value in which all texts are escaped, so that `expand` returns the original
    texts.
    """
    changed: object = value
    if isinstance(value, dict):
        changed = {key: escaped(item) for key, item in value.items()}
    elif isinstance(value, list):
        changed = [escaped(item) for item in value]
    elif isinstance(value, str):
        changed = value.replace("${", "$${")
    return cast(V, changed)


def _variable_value(reference: re.Match[str]) -> str:
    if reference[0] == "$${":
        return "${"
    body = _BODY.fullmatch(reference[1])
    if body is None or not reference[2]:
        raise ValueError(f"`{reference[0]}` is not of the form `${{NAME}}` or `${{NAME:-default}}`")
    name, has_default, default = body.groups()
    if not name.startswith(READABLE) and name not in os.environ.get(MORE, "").split(","):
        raise ValueError(
            f"the environment variable {name} is not read: its name does not begin with "
            f"{READABLE}, and it was not allowed by `--env {name}`"
        )
    value = os.environ.get(name)
    if has_default and not value:
        return default or ""
    if value is None:
        raise ValueError(f"the environment variable {name} is not set")
    return value
