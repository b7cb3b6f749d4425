"""`${VAR}` and `${VAR:-default}` in the scalars of a spec."""

from __future__ import annotations

import os
import re
from typing import Any

_REFERENCE = re.compile(r"\$\$\{|\$\{([^{}]*)(\}?)")
_BODY = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)(:-(.*))?", re.DOTALL)


def expand(text: str) -> str:
    """The text with every reference replaced; `$${` stands for `${`.

    As in a shell, `:-` gives its default for an unset and for an empty variable.

    Raises
    ------
    ValueError
        A variable that is not set and has no default, or something after `${` that is no variable.
    """
    return _REFERENCE.sub(_value, text) if "${" in text else text


def escaped(value: Any) -> Any:
    """A value with texts, wherever they are in it, that `expand` turns back into these."""
    if isinstance(value, dict):
        return {key: escaped(item) for key, item in value.items()}
    if isinstance(value, list):
        return [escaped(item) for item in value]
    return value.replace("${", "$${") if isinstance(value, str) else value


def _value(reference: re.Match[str]) -> str:
    if reference[0] == "$${":
        return "${"
    inside, closed = reference.groups()
    body = _BODY.fullmatch(inside)
    if body is None or not closed:
        raise ValueError(f"`{reference[0]}` is not `${{NAME}}` or `${{NAME:-default}}`")
    name, has_default, default = body.groups()
    value = os.environ.get(name)
    if has_default and not value:
        return default or ""
    if value is None:
        raise ValueError(f"environment variable {name} is not set")
    return value
