"""Find extensions of `mapmore`: files in one of its own folders, or entry points of other packages.

An entry point `NAME = "module"` or `NAME = "module:OBJECT"` in the group `mapmore.GROUP` names a
module, or an object in a module. The module has the same contents as a file in the folder of
mapmore for this group. In the group `readers`, for example, it defines a `READER`, or several
`READERS`. Groups are `formulas`, `readers`, `operators`, `families`, `figures`, `exports`, `kinds`
and `commands`; mapmore's annexes also use `stages` and `python`.

Nothing is imported before it is needed. An extension that is broken, or that has the name of one of
mapmore's own extensions, is left out with a warning. If the environment variable MAPMORE_NO_PLUGINS
is set, only mapmore's own extensions are used.
"""

from __future__ import annotations

import io
import os
import signal
import sys
import warnings
from collections.abc import Collection, Iterator
from contextlib import chdir, contextmanager, redirect_stdout
from functools import cache
from importlib import import_module
from importlib.metadata import Distribution, EntryPoint, distributions
from pkgutil import iter_modules
from threading import current_thread, main_thread
from traceback import walk_tb
from types import FrameType
from typing import Any, Generic, NamedTuple, TypeVar

from mapmore_cli.domain.errors import UsageError


class NotInstalled(UsageError):
    """Error for an entry point whose module or object cannot be imported."""


class PluginLeftOut(UserWarning):
    """Warning that a plug-in, or a part of it, is broken and was left out."""


P = TypeVar("P")


class Added(NamedTuple, Generic[P]):
    """An extension with its name, and the module or object in which it was found."""

    name: str
    value: P
    source: object


def parts(
    group: str, form: type[P], package: str = "", reserved: Collection[str] = ()
) -> Iterator[Added[P]]:
    """Yield all extensions of a group that have the type `form`. The extensions in mapmore's folder
    `package` come first, in the order of their file names. The extensions from entry points follow.

    The name of an extension is its attribute `name`, or the name of its entry point. If two
    extensions have the same name, the first is used; if both are mapmore's own, a ValueError is
    raised. An extension of another package is left out if its name is `reserved`, because mapmore
    uses this name for something else, or if its method `checked` raises an error.
    """
    names = set[str]()
    for module in iter_modules(sys.modules[package].__path__) if package else ():
        for part in _parts_in(group, module.name, import_module(f"{package}.{module.name}")):
            if isinstance(part.value, form):
                if part.name in names:
                    raise ValueError(f"two files of {package} declare `{part.name}`")
                names.add(part.name)
                yield Added(part.name, part.value, part.source)
    names.update(reserved)
    for name in sorted(entry_points(group)):
        try:
            added = list[Added[P]]()
            for part in _parts_in(group, name, load(group, name)):
                if not isinstance(part.name, str):
                    raise TypeError("its name is not a text")
                if part.name in names:
                    raise ValueError(f"there is already a `{part.name}`")
                if not isinstance(part.value, form):
                    raise TypeError(f"{type(part.value).__name__} is no {form.__name__}")
                # `checked` is called only for plug-ins; tests check mapmore's own extensions
                check = getattr(part.value, "checked", None)
                if check and type(part.value) is form:
                    check()
                added.append(Added(part.name, part.value, part.source))
        # a plug-in may raise any exception, but all other plug-ins must still work
        except Exception as fault:
            leave_plugin_out(group, name, fault.__cause__ or fault)
            continue
        names.update(part.name for part in added)
        yield from added


def leave_plugin_out(group: str, name: str, fault: BaseException) -> None:
    """Warn that a part of a plugin is left out, and why."""
    _leave_out(group, entry_points(group)[name], f"{type(fault).__name__}: {fault}")


def _leave_out(group: str, point: EntryPoint, why: str) -> None:
    fault = f"plug-in `{point.name}` ({group}) of {_owner(point)} is left out"
    warnings.warn(f"{fault}: {why}", PluginLeftOut, stacklevel=4)


def _owner(point: EntryPoint) -> str:
    """Return the name of the package to which an entry point belongs."""
    return _name_of(point.dist) if point.dist else point.module


def blamed(fault: BaseException) -> str | None:
    """Return the name of the package whose plug-in raised an exception. Return None if no function
    of a plug-in took part.
    """
    packages = {point.module.partition(".")[0] for point in _installed()}
    frames = (frame for frame, _ in walk_tb(fault.__traceback__))
    names = (str(frame.f_globals.get("__name__")).partition(".")[0] for frame in frames)
    return next((name for name in names if name in packages - {"mapmore_cli"}), None)


def _parts_in(group: str, name: str, source: object) -> Iterator[Added[object]]:
    """Yield the extensions in a module (`source`): the value of its attribute with the name of the
    group, in the plural or the singular, for example `READERS` or `READER`. If `source` has no such
    attribute, it is itself the extension.
    """
    many = group.upper()
    single = f"{many[:-3]}Y" if many.endswith("IES") else many[:-1]
    held = getattr(source, many, None) or getattr(source, single, source)
    for value in held if isinstance(held, list | tuple) else (held,):
        yield Added(getattr(value, "name", name), value, source)


OURS, OUR_MODULE = "mapmore", "mapmore_cli"
"""Names of our own package, whose parts no other package can replace, and of its module."""

NONE_OF_OTHERS = "MAPMORE_NO_PLUGINS"
"""Environment variable that leaves out the plugins of other packages, also in worker processes."""


def leave_out_others() -> None:
    """Use no plug-ins of other packages, in this process and in its child processes."""
    os.environ[NONE_OF_OTHERS] = "1"
    for remembered in (_installed, entry_points):
        remembered.cache_clear()


def _is_ours(point: EntryPoint) -> bool:
    """Return True if an entry point belongs to mapmore itself. The name of the package is not
    enough for this, because another package may have the same name.
    """
    return point.module.partition(".")[0] == OUR_MODULE and _owner(point) == OURS


# cached, because reading the list of installed packages takes most of the time of a start
@cache
def _installed() -> tuple[EntryPoint, ...]:
    """Return the entry points of mapmore itself, and the entry points that other packages provide
    for it. A package whose list of entry points cannot be read is left out.
    """
    points, packages = list[EntryPoint](), set[tuple[str, bool]]()
    only_ours = NONE_OF_OTHERS in os.environ
    for package in distributions(name=OURS) if only_ours else distributions():
        try:
            points_of_package = [
                point for point in package.entry_points if point.group.startswith("mapmore.")
            ]
            if not points_of_package:
                continue
            # if an entry point has the wrong form, this line raises an error
            is_ours = True in [_is_ours(point) for point in points_of_package]
            # if a package is installed twice, Python imports the first one on `sys.path`
            identity = (_name_of(package), is_ours)
            if identity not in packages and (is_ours or not only_ours):
                packages.add(identity)
                points += points_of_package
        # a broken package may raise any exception, but other packages must still work
        except Exception as fault:
            left_out = f"the plug-ins of {_name_of(package)} are left out"
            why = f"its entry_points.txt cannot be read ({type(fault).__name__}: {fault})"
            warnings.warn(f"{left_out}: {why}", PluginLeftOut, stacklevel=2)
    return tuple(points)


def _name_of(package: Distribution) -> str:
    """Return the name of a package, or its folder if the package has no readable name."""
    folder = str(package.locate_file(""))
    try:
        return str(package.name or folder)
    except Exception:  # the metadata may be broken
        return folder


@cache
def entry_points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name. If several entry points have the same name,
    mapmore's own is used; if none of them is mapmore's own, the first in alphabetical order of
    their modules is used. A warning names each entry point that is not used, unless it leads to the
    same module or object as the one that is used.
    """
    by_name = dict[str, EntryPoint]()
    of_group = (point for point in _installed() if point.group == f"mapmore.{group}")
    for point in sorted(of_group, key=lambda point: (not _is_ours(point), point.value)):
        if point.name not in by_name:
            by_name[point.name] = point
        elif point.value != by_name[point.name].value:
            _leave_out(
                group, point, f"`{point.name}` already exists in {_owner(by_name[point.name])}"
            )
    return by_name


class _ToStderr(io.RawIOBase):
    """A binary stream that decodes its data from UTF-8 and writes the text to stderr. If a plug-in
    closes this stream, stderr stays open.
    """

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        content = bytes(data)
        sys.stderr.write(content.decode(errors="replace"))
        return len(content)

    def flush(self) -> None:
        sys.stderr.flush()

    def fileno(self) -> int:
        return sys.stderr.fileno()

    def close(self) -> None:
        pass


@contextmanager
def printing_to_stderr() -> Iterator[None]:
    """Redirect stdout to stderr within the context, because stdout is for results only. This
    includes what C libraries and child processes print.
    """
    sys.stdout.flush()
    # a text stream with a buffer, because a plug-in may call `reconfigure` or use `buffer`
    raw: Any = _ToStderr()
    stream = io.TextIOWrapper(raw, "utf-8", "backslashreplace", write_through=True)
    with redirect_stdout(stream):
        kept = os.dup(1)
        os.dup2(2, 1)
        try:
            yield
        finally:
            os.dup2(kept, 1)
            os.close(kept)


@cache
def load(group: str, name: str) -> Any:
    """Return the object that an entry point names. Raises NotInstalled if it cannot be imported."""
    point = entry_points(group)[name]
    with interrupts_of_user() as interrupts:
        try:
            if _is_ours(point):
                return point.load()
            # packages may print, or change warning filters and the current folder, on import
            with printing_to_stderr(), warnings.catch_warnings(), chdir(os.curdir):
                return point.load()
        # an import may raise any exception, even SystemExit or KeyboardInterrupt
        except BaseException as fault:
            if interrupts:
                raise KeyboardInterrupt from fault
            why = str(fault) or type(fault).__name__
            raise NotInstalled(
                f"`{name}` is not installed: {point.value} cannot be imported ({why})",
                f"install the package that contains {point.module.partition('.')[0]}, with all "
                "its parts",
            ) from fault


@contextmanager
def interrupts_of_user() -> Iterator[list[int]]:
    """Yield a list, to which the signal number is appended when the user presses Ctrl-C within the
    context. Ctrl-C still raises KeyboardInterrupt. If KeyboardInterrupt is raised and the list is
    empty, the exception was raised by code, not by the user.
    """
    interrupts, before = list[int](), signal.getsignal(signal.SIGINT)

    def note(number: int, frame: FrameType | None) -> None:
        interrupts.append(number)
        before(number, frame)  # type: ignore[operator, misc]

    # Python handles Ctrl-C in the main thread only, and a signal handler can be set only there
    if not callable(before) or current_thread() is not main_thread():
        yield interrupts
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield interrupts
    finally:
        if signal.getsignal(signal.SIGINT) is note:
            signal.signal(signal.SIGINT, before)
