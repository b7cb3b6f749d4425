"""Write values as YAML that YAML 1.1 and YAML 1.2 read in the same way."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import yaml

from mapmore_cli.study.variables import escaped
from mapmore_cli.study.yaml_loader import RESOLVERS, TAG

BOOLEANS_OF_1_1 = frozenset({"y", "n", "yes", "no", "on", "off"})

ONE_LINE = 80
"""Largest number of characters of a list or mapping that is written on one line."""


def _on_one_line(node: yaml.Node) -> int:
    """Mark short lists and mappings to be written on one line, and return the approximate number of
    characters of a node.
    """
    if not isinstance(node, yaml.CollectionNode):
        return ONE_LINE if "\n" in node.value else len(node.value) + 2
    parts = [part for part in node.value for part in (part if isinstance(part, tuple) else (part,))]
    size = 2 + sum(map(_on_one_line, parts))
    # an item such as `- polynomial: {...}` needs no braces around the item itself
    is_wrapped = len(parts) == 2 and isinstance(parts[1], yaml.CollectionNode)
    node.flow_style = size <= ONE_LINE and not is_wrapped
    return size


class _CoreDumper(yaml.SafeDumper):
    """Dumper that puts quotes around every text that would be read as something else without
    quotes, for example as a number. It writes no anchors.
    """

    yaml_implicit_resolvers = RESOLVERS

    def ignore_aliases(self, _data: object) -> bool:
        return True

    def serialize(self, node: yaml.Node) -> None:
        """Write short nodes on one line, but never the whole document."""
        _on_one_line(node)
        if isinstance(node, yaml.CollectionNode):
            node.flow_style = False
        super().serialize(node)

    def represent_str(self, data: str) -> yaml.ScalarNode:
        """Escape the line breaks that exist in Unicode only; PyYAML would write them unescaped and
        read them back as spaces.

        Words that a reader of YAML 1.1 takes for true or false, for example the key `on`, are
        quoted as well.
        """
        style = (
            '"'
            if any(char in data for char in "\x85\u2028\u2029") or data.lower() in BOOLEANS_OF_1_1
            else None
        )
        return self.represent_scalar(f"{TAG}str", data, style)


_CoreDumper.add_representer(str, _CoreDumper.represent_str)


@dataclass(frozen=True)
class _Part:
    """A value that is compared by its Python spelling, so that `1`, `1.0` and `True` are
    different.
    """

    written: str
    value: object = field(compare=False)


def dump(value: object) -> str:
    """Return YAML text from which `CoreLoader` reads the same value.

    The keys of a document are written one by one and cached: the specs of a campaign differ in few
    keys, and writing YAML is slower than reading it.
    """
    parts: list[object] = (
        [{key: member} for key, member in value.items()] if isinstance(value, dict) else []
    )
    return "".join(_dumped(_Part(repr(part), part)) for part in parts or [value])


@lru_cache(maxsize=256)
def _dumped(part: _Part) -> str:
    text: str = yaml.dump(
        part.value, Dumper=_CoreDumper, sort_keys=False, allow_unicode=True, width=120
    )
    return text


def as_overrides(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Return settings by key path (`{"fit.max_terms": 2}`) in the form that `--set` takes."""
    return tuple(
        f"{key}={json.dumps(escaped(value), ensure_ascii=False)}" for key, value in settings.items()
    )
