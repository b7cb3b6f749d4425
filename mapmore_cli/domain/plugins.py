"""What adds itself to `mapmore`: by a file in a folder, or by an entry point.

The annexes that ship and packages of other people use one way: an entry point `NAME =
"module:OBJECT"` in the group `mapmore.GROUP` adds OBJECT under NAME. Groups are `commands`,
`kinds`, `figures` and `stages`. Nothing is imported before it is asked for. A part that cannot be
imported is left out, and named by whoever asks for it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

from mapmore_cli.domain.errors import UsageError


class NotInstalled(UsageError):
    """A part that an entry point names cannot be imported."""


@cache
def points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name; of two with one name, the first by module."""
    by_module = sorted(entry_points(group=f"mapmore.{group}"), key=lambda point: point.value)
    return {point.name: point for point in reversed(by_module)}


@cache
def load(group: str, name: str) -> Any:
    """Return what an entry point names; raises NotInstalled where it cannot be imported."""
    point = points(group)[name]
    try:
        return point.load()
    except Exception as fault:  # whatever is wrong there, the rest goes on without it
        raise NotInstalled(
            f"`{name}` is not installed: {point.value} cannot be imported ({fault})",
            f"install the package that has {point.module.partition('.')[0]}, with all its parts",
        ) from fault


def added(group: str) -> dict[str, Any]:
    """Return everything that entry points of a group add, by name; what cannot be imported is left
    out.
    """
    return {name: part for name in sorted(points(group)) if (part := _or_none(group, name))}


def missing(group: str) -> tuple[str, ...]:
    """Return the names of a group whose parts cannot be imported."""
    return tuple(name for name in sorted(points(group)) if _or_none(group, name) is None)


def _or_none(group: str, name: str) -> Any:
    try:
        return load(group, name)
    except NotInstalled:
        return None


def modules(package: str) -> Iterator[ModuleType]:
    """Import the modules and folders of a package, in the order of their names."""
    for one in iter_modules(sys.modules[package].__path__):
        yield import_module(f"{package}.{one.name}")
