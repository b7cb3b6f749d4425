"""YAML with the scalars of version 1.2's core schema, for reading and writing, and `${VAR}` in them.

Plain PyYAML follows YAML 1.1, in which `1e-3` is text, `no` is false, `010` is eight and `1:30` is ninety.
"""

from __future__ import annotations

import os
import re
from typing import Any

import yaml

_TAG = "tag:yaml.org,2002:"
_SCALARS = (  # tag, pattern, possible first characters (None: the empty text)
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", list("-+0123456789")),
    ("float", r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)", list("-+.0123456789")),
)
_RESOLVERS = {
    first: [(_TAG + tag, re.compile(f"(?:{pattern})\\Z", re.ASCII)) for tag, pattern, firsts in _SCALARS if first in firsts]
    for first in {first for _, _, firsts in _SCALARS for first in firsts}
}

DEEPEST = 40
"""Levels of nesting that are read; a spec needs ten."""


class TooDeep(Exception):
    """Nested deeper than `DEEPEST`; the argument is the mark of the place."""


class CoreLoader(yaml.SafeLoader):
    """Composes nodes with YAML 1.2 core tags; `<<` is an ordinary key."""

    yaml_implicit_resolvers = _RESOLVERS

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """A node, unless it lies too deep (PyYAML would recurse until Python's limit)."""
        self._depth += 1
        if parent is not None and self._depth > DEEPEST:
            raise TooDeep(parent.start_mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node


_BOOLEANS_OF_1_1 = frozenset({"y", "n", "yes", "no", "on", "off"})


class _CoreDumper(yaml.SafeDumper):
    """Quotes what `CoreLoader` would otherwise read as something else; writes no anchors."""

    yaml_implicit_resolvers = _RESOLVERS

    def ignore_aliases(self, _data: Any) -> bool:
        return True

    def represent_str(self, data: str) -> yaml.ScalarNode:
        """Escapes the line breaks that only Unicode knows; PyYAML would write them out, to be read back as spaces.

        Words that readers of YAML 1.1 take for true or false, as the key `on`, are quoted for their sake.
        """
        style = '"' if any(char in data for char in "\x85\u2028\u2029") or data.lower() in _BOOLEANS_OF_1_1 else None
        return self.represent_scalar(f"{_TAG}str", data, style)


_CoreDumper.add_representer(str, _CoreDumper.represent_str)


def tag_of(text: str) -> str:
    """The core type of a plain scalar: `null`, `bool`, `int`, `float` or `str`."""
    for tag, pattern in _RESOLVERS.get(text[:1], []):
        if pattern.match(text):
            return tag.removeprefix(_TAG)
    return "str"


def scalar(tag: str, text: str) -> str | int | float | bool | None:
    """The value of a scalar with one of the core tags.

    Raises
    ------
    ValueError
        An explicit tag that is none of them, or that the text does not fit (`!!int x`), or an integer of thousands of digits.
    """
    kind = tag.removeprefix(_TAG)
    if kind == "str":
        return text
    if kind not in ("null", "bool", "int", "float"):
        raise ValueError(f"tag {tag.replace(_TAG, '!!')} is not used in a spec")
    if tag_of(text) != kind and not (kind == "float" and tag_of(text) == "int"):
        raise ValueError(f"{text!r} is no {kind}")
    match kind:
        case "null":
            return None
        case "bool":
            return text.lower() == "true"
        case "int":
            return int(text, {"0o": 8, "0x": 16}.get(text[:2], 10))
        case _:
            return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))


def dump(value: Any) -> str:
    """YAML that `CoreLoader` reads back to the same value."""
    text: str = yaml.dump(value, Dumper=_CoreDumper, sort_keys=False, allow_unicode=True, width=120)
    return text


READABLE = "MAPMORE_"
"""How the environment variables begin that any spec may read: a spec from a stranger shall see no key or password."""

MORE = "MAPMORE_ENV"
"""The variable that lists further ones, with commas between them; `--env` adds to it, so that worker processes know them too."""

VARIABLES = "set it, give a default as `${NAME:-default}`, or write `$${` for a plain `${`"
"""What to do about a variable that cannot be expanded."""

_REFERENCE = re.compile(r"\$\$\{|\$\{([^{}]*)(\}?)")
_BODY = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)(:-(.*))?", re.DOTALL)


def expand(text: str) -> str:
    """The text with every reference replaced; `$${` stands for `${`.

    As in a shell, `:-` gives its default for an unset and for an empty variable.

    Raises
    ------
    ValueError
        A variable that is not set and has no default, one that no spec may read, or something after `${` that is no variable.
    """
    return _REFERENCE.sub(_value, text) if "${" in text else text


def unescaped(text: str) -> str:
    """Return a text that is no path, with `${` for each `$${`; ValueError where it holds a variable."""
    if found := next((match for match in _REFERENCE.finditer(text) if match[0] != "$${"), None):
        raise ValueError(f"`{found[0]}` stands in a text that is no path: variables are expanded in paths alone")
    return text.replace("$${", "${")


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
    if not name.startswith(READABLE) and name not in os.environ.get(MORE, "").split(","):
        raise ValueError(f"environment variable {name} is not read: it is no {READABLE}*, and no `--env {name}` allows it")
    value = os.environ.get(name)
    if has_default and not value:
        return default or ""
    if value is None:
        raise ValueError(f"environment variable {name} is not set")
    return value
