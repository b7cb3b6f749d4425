"""What adds itself to `mapmore`: by a file in one of our folders, or by an entry point of anybody's
package.

Both have one form. An entry point `NAME = "module"` or `NAME = "module:OBJECT"` in the group
`mapmore.GROUP` names what a file of ours holds: for `readers` a `READER`, or several `READERS`.
Groups are `formulas`, `readers`, `operators`, `families`, `figures`, `exports`, `kinds` and
`commands`; our annexes also use `stages` and `python`. Nothing is imported before it is asked for.
A part that is broken is named in a warning and left out, and so is one that has the name of a part
of ours. Where the variable MAPMORE_NO_PLUGINS is set, there are only ours.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, redirect_stdout
from functools import cache
from importlib import import_module
from importlib.metadata import Distribution, EntryPoint, distribution, distributions
from pkgutil import iter_modules
from traceback import walk_tb
from typing import Any, Generic, NamedTuple, TypeVar

from mapmore_cli.domain.errors import UsageError


class NotInstalled(UsageError):
    """A part that an entry point names cannot be imported."""


class PluginLeftOut(UserWarning):
    """A part of a plug-in that is broken, and left out."""


P = TypeVar("P")


class Added(NamedTuple, Generic[P]):
    """A part by its own name, and the file or object that holds it."""

    name: str
    value: P
    source: object


def parts(group: str, form: type[P], package: str = "") -> Iterator[Added[P]]:
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
                yield Added(part.name, part.value, part.source)
    for name in sorted(entry_points(group)):
        try:
            found = list[Added[P]]()
            for part in _parts_in(group, name, load(group, name)):
                if not isinstance(part.value, form):
                    raise TypeError(f"{type(part.value).__name__} is no {form.__name__}")
                if part.name in taken:
                    raise ValueError(f"there is already a `{part.name}`")
                found.append(Added(part.name, part.value, part.source))
        except Exception as fault:  # whatever is wrong there, the rest goes on without it
            leave_plugin_out(group, name, fault.__cause__ or fault)
            continue
        taken.update(part.name for part in found)
        yield from found


def leave_plugin_out(group: str, name: str, fault: BaseException) -> None:
    """Warn that a part of a plug-in is left out, and why."""
    _leave_out(group, entry_points(group)[name], f"{type(fault).__name__}: {fault}")


def _leave_out(group: str, point: EntryPoint, why: str) -> None:
    what = f"plug-in `{point.name}` ({group}) of {_owner(point)} is left out"
    warnings.warn(f"{what}: {why}", PluginLeftOut, stacklevel=4)


def _owner(point: EntryPoint) -> str:
    """Return the name of the package that an entry point comes with."""
    return point.dist.name if point.dist else point.module


def blamed(fault: BaseException) -> str | None:
    """Return the package whose plug-in was at work when something failed; None for our own."""
    packages = {point.module.partition(".")[0] for point in _installed()}
    frames = (frame for frame, _ in walk_tb(fault.__traceback__))
    names = (str(frame.f_globals.get("__name__")).partition(".")[0] for frame in frames)
    return next((name for name in names if name in packages - {"mapmore_cli"}), None)


def _parts_in(group: str, name: str, source: object) -> Iterator[Added[object]]:
    """Yield the parts that a module holds under the name of the group, in the singular or in the
    plural; an object without them is itself the part.
    """
    many = group.upper()
    single = f"{many[:-3]}Y" if many.endswith("IES") else many[:-1]
    held = getattr(source, many, None) or getattr(source, single, source)
    for value in held if isinstance(held, list | tuple) else (held,):
        yield Added(getattr(value, "name", name), value, source)


OURS = "mapmore"
"""The package whose parts none of another package replaces."""

NONE_OF_OTHERS = "MAPMORE_NO_PLUGINS"
"""The variable that leaves out the plug-ins of other packages, also in worker processes."""


def leave_out_others() -> None:
    """Leave out the plug-ins of all other packages, in this process and those that it starts."""
    os.environ[NONE_OF_OTHERS] = "1"
    for remembered in (_installed, entry_points):
        remembered.cache_clear()


@cache  # reading what is installed takes longer than all else at the start
def _installed() -> tuple[EntryPoint, ...]:
    """Return the entry points of mapmore and those of other packages for it; a package whose list
    of entry points cannot be read is left out.
    """
    found, packages = list[EntryPoint](), set[str]()
    for package in [distribution(OURS)] if os.environ.get(NONE_OF_OTHERS) else distributions():
        try:
            ours = [point for point in package.entry_points if point.group.startswith("mapmore.")]
            # the first on Python's path is the one that is imported
            if not ours or package.name in packages:
                continue
            packages.add(package.name)
            _ = [point.module for point in ours]  # asks for the form of the value
        except Exception as fault:  # whatever is wrong there, the rest goes on without it
            what = f"the plug-ins of {_name_of(package)} are left out"
            why = f"its entry_points.txt cannot be read ({type(fault).__name__}: {fault})"
            warnings.warn(f"{what}: {why}", PluginLeftOut, stacklevel=2)
            continue
        found += ours
    return tuple(found)


def _name_of(package: Distribution) -> str:
    try:
        return str(package.name)
    except Exception:  # its other files are broken too
        return str(package.locate_file(""))


@cache
def entry_points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name; of two with one name, ours, otherwise the first
    by module. The other one is named in a warning.
    """
    found = dict[str, EntryPoint]()
    of_group = (point for point in _installed() if point.group == f"mapmore.{group}")
    for point in sorted(of_group, key=lambda point: (_owner(point) != OURS, point.value)):
        if point.name not in found:
            found[point.name] = point
        elif point.value != found[point.name].value:
            _leave_out(
                group, point, f"`{point.name}` already exists in {_owner(found[point.name])}"
            )
    return found


@contextmanager
def _printing_to_stderr() -> Iterator[None]:
    """Let what is printed meanwhile go to stderr, also by libraries in C: results alone belong on
    stdout.
    """
    with redirect_stdout(sys.stderr):
        kept = os.dup(1)
        os.dup2(2, 1)
        try:
            yield
        finally:
            os.dup2(kept, 1)
            os.close(kept)


@cache
def load(group: str, name: str) -> Any:
    """Return what an entry point names; raises NotInstalled if it cannot be imported."""
    point = entry_points(group)[name]
    try:
        with nullcontext() if _owner(point) == OURS else _printing_to_stderr():
            return point.load()
    except (Exception, SystemExit) as fault:
        raise NotInstalled(
            f"`{name}` is not installed: {point.value} cannot be imported ({fault})",
            f"install the package that contains {point.module.partition('.')[0]}, with all "
            "its parts",
        ) from fault
