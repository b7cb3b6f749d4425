"""What adds itself to `mapmore`: by a file in one of our folders, or by an entry point of anybody's
package.

Both have one form. An entry point `NAME = "module"` or `NAME = "module:OBJECT"` in the group
`mapmore.GROUP` names what a file of ours holds: for `readers` a `READER`, or several `READERS`.
Groups are `formulas`, `readers`, `operators`, `families`, `figures`, `exports`, `kinds` and
`commands`; our annexes also use `stages` and `python`. Nothing is imported before it is asked for.
A part that is broken is named in a warning and left out.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pkgutil import iter_modules
from traceback import walk_tb
from typing import Any, NamedTuple

from mapmore_cli.domain.errors import UsageError


class NotInstalled(UsageError):
    """A part that an entry point names cannot be imported."""


class PluginLeftOut(UserWarning):
    """A part of a plug-in that is broken, and left out."""


class Added(NamedTuple):
    """A part by its own name, and the file or object that holds it."""

    name: str
    value: Any
    source: Any


def parts(group: str, form: Any, package: str = "") -> Iterator[Added]:
    """Yield every part of a group, of the type `form`: those in the files of our `package` in the
    order of their names, then those of entry points.

    A part is called by its `name`, else by that of its entry point. Of two with one name the first
    counts.
    """
    taken = set[str]()
    for one in iter_modules(sys.modules[package].__path__) if package else ():
        for part in _parts_in(group, one.name, import_module(f"{package}.{one.name}")):
            if isinstance(part.value, form):
                taken.add(part.name)
                yield part
    for name in sorted(points(group)):
        try:
            found = list(_parts_in(group, name, load(group, name)))
            for part in found:
                if not isinstance(part.value, form):
                    raise TypeError(f"{type(part.value).__name__} is no {form.__name__}")
                if part.name in taken:
                    raise ValueError(f"`{part.name}` is there already")
        except Exception as fault:  # whatever is wrong there, the rest goes on without it
            leave_plugin_out(group, name, fault.__cause__ or fault)
            continue
        taken.update(part.name for part in found)
        yield from found


def leave_plugin_out(group: str, name: str, fault: BaseException) -> None:
    """Warn that a part of a plug-in is left out, and why."""
    point = points(group)[name]
    package = point.dist.name if point.dist else point.module
    what = f"plug-in `{name}` ({group}) of {package} is left out"
    warnings.warn(f"{what}: {type(fault).__name__}: {fault}", PluginLeftOut, stacklevel=3)


def blamed(fault: BaseException) -> str | None:
    """Return the package whose plug-in was at work when something failed; None for our own."""
    packages = {
        point.module.partition(".")[0]
        for group in _installed().groups
        if group.startswith("mapmore.")
        for point in _installed().select(group=group)
    }
    frames = (frame for frame, _ in walk_tb(fault.__traceback__))
    names = (str(frame.f_globals.get("__name__")).partition(".")[0] for frame in frames)
    return next((name for name in names if name in packages - {"mapmore_cli"}), None)


def _parts_in(group: str, name: str, source: Any) -> Iterator[Added]:
    """Yield the parts that a module holds under the name of the group, in the singular or in the
    plural; an object without them is itself the part.
    """
    many = group.upper()
    single = f"{many[:-3]}Y" if many.endswith("IES") else many[:-1]
    held = getattr(source, many, None) or getattr(source, single, source)
    for value in held if isinstance(held, list | tuple) else (held,):
        yield Added(getattr(value, "name", name), value, source)


@cache  # reading what is installed takes longer than all else at the start
def _installed() -> Any:
    return entry_points()


@cache
def points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name; of two with one name, the first by module."""
    of_group = _installed().select(group=f"mapmore.{group}")
    by_module = sorted(of_group, key=lambda point: point.value)
    return {point.name: point for point in reversed(by_module)}


@cache
def load(group: str, name: str) -> Any:
    """Return what an entry point names; raises NotInstalled where it cannot be imported."""
    point = points(group)[name]
    try:
        return point.load()
    except (Exception, SystemExit) as fault:
        raise NotInstalled(
            f"`{name}` is not installed: {point.value} cannot be imported ({fault})",
            f"install the package that has {point.module.partition('.')[0]}, with all its parts",
        ) from fault
