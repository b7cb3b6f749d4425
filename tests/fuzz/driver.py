"""Tries many inputs of one kind, each within bounds of time and memory, and counts what becomes of
them.

Input `number` of a target is made by `random.Random(f"{seed}/{name}/{number}")` alone, so a finding
can be tried again by its number. The inputs run in a fork; where one of them kills it, the next
fork goes on behind it.
"""

from __future__ import annotations

import dis
import gc
import os
import random
import resource
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import contextmanager, nullcontext
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType

import mapmore_cli

PACKAGE = Path(mapmore_cli.__file__).parent
LONGEST = 5  # seconds of one input
ROOM = 1 << 30  # bytes of memory that inputs may take beside what the program had at its start
SILENCE = 60.0  # seconds between two words of how far it is

Try = Callable[[random.Random, int, Path], str]
"""Makes an input of a chance, tries it in a folder, and says what became of it; the number is that
of the input.
"""


@dataclass(frozen=True)
class Target:
    """What is fuzzed: `name`, how one input is tried, the parts of the package that are meant, and
    the outcomes that are past the syntax.

    `library` is what crashes and hangs are laid to where the input goes through foreign machine
    code. The first `traced` inputs are tried under a tracer that notes the lines which run, and
    takes long. `warm` imports and makes what all inputs need, once, before the forks.
    """

    name: str
    attempt: Try
    parts: tuple[str, ...]
    past: tuple[str, ...] = ()
    library: str | None = None
    longest: int = LONGEST
    traced: int = 100
    warm: Callable[[Path], object] = lambda _folder: None


@dataclass
class Findings:
    """Outcomes and how often they came, faults with the number of their input, the lines that ran,
    and whether Ctrl-C ended it early.
    """

    outcomes: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    seen: set[tuple[str, int]] = field(default_factory=set)
    lines: int = 0
    interrupted: bool = False

    @property
    def ran(self):
        return len(self.seen)


class Fault(Exception):
    """What the program may not do: raised by a target where no exception shows it."""


def explore(
    target,
    count,
    seed,
    folder,
    traced=None,
    tell=lambda _words: None,
):
    """Try `count` inputs, or fewer where Ctrl-C ends it; `traced` as the target says, if not
    otherwise; `tell` how far it is.
    """
    found, start, traced, last = (
        Findings(),
        0,
        target.traced if traced is None else traced,
        time.monotonic(),
    )

    def told():
        nonlocal last
        if time.monotonic() - last > SILENCE:
            last = time.monotonic()
            faults = (
                f"{len(found.faults)} faults, the last one {found.faults[-1]}"
                if found.faults
                else "no fault"
            )
            tell(f"{target.name}: {found.outcomes.total()} of {count} tried, {faults}")

    try:
        target.warm(folder)
        while start < count:
            numbers = range(start, min(count, start + traced) if start < traced else count)
            start = _batch(target, numbers, seed, folder, found, start < traced, told)
    except KeyboardInterrupt:
        found.interrupted = True
    wanted = lines_of(target.parts)
    found.seen &= wanted
    found.lines = len(wanted)
    return found


def _batch(
    target,
    numbers,
    seed,
    folder,
    found,
    tracing,
    told,
):
    """Try inputs in one fork; the number of the first one that it left."""
    read, write = os.pipe()
    gc.freeze()  # what is there before the inputs is not looked through again and again
    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a word
        os.close(read)
        with os.fdopen(write, "w", encoding="utf-8", errors="replace", buffering=1) as report:
            _inputs(target, numbers, seed, folder, report, tracing)
        os._exit(0)
    os.close(write)
    done = numbers.start
    try:
        with os.fdopen(read, encoding="utf-8", errors="replace") as report:
            for line in report:
                told()
                kind, _, text = line.rstrip("\n").partition(" ")
                if kind == "line":
                    file, _, number = text.rpartition(":")
                    found.seen.add((file, int(number)))
                elif kind in ("done", "fault"):
                    found.outcomes[text if kind == "done" else "FAULT"] += 1
                    found.faults += [f"{target.name} {done}: {text}"] if kind == "fault" else []
                    done += 1
    except BaseException:  # no fork goes on alone
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        hung = os.WTERMSIG(status) == signal.SIGVTALRM
        what = (
            f"longer than {target.longest} s" if hung else f"ended by signal {os.WTERMSIG(status)}"
        )
        found.outcomes[
            f"{target.library} {'hangs' if hung else 'crashes'}" if target.library else "FAULT"
        ] += 1
        found.faults += [] if target.library else [f"{target.name} {done}: {what}"]
        done += 1
    return done


def _inputs(target, numbers, seed, folder, report, tracing):
    # libraries reserve address space that they never use: what counts is beside what was reserved
    # at the start
    taken = (
        int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        if Path("/proc/self/statm").exists()
        else None
    )
    if taken is not None:
        resource.setrlimit(resource.RLIMIT_AS, (taken + ROOM, taken + ROOM))
    for number in numbers:
        signal.setitimer(signal.ITIMER_VIRTUAL, target.longest * (20 if tracing else 1))
        chance = random.Random(f"{seed}/{target.name}/{number}")
        try:
            with traced(target.parts) if tracing else nullcontext(set[tuple[str, int]]()) as seen:
                outcome = target.attempt(chance, number, folder)
            report.writelines(f"line {file}:{line}\n" for file, line in sorted(seen))
            print("done", outcome, file=report)
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
            print("fault", f"{said} ({Path(last.filename).name}:{last.lineno})", file=report)
    signal.setitimer(signal.ITIMER_VIRTUAL, 0)


def refused(error):
    return f"refused (exit {error.exit_code})"


@contextmanager
def traced(parts):
    """Note the lines of some parts of the package that run."""
    seen = set()
    files = {str(path) for path in files_of(parts)}

    def within(frame, event, _argument):
        if event == "line":
            seen.add((frame.f_code.co_filename, frame.f_lineno))
        return within

    def enter(frame, _event, _argument):
        return within if frame.f_code.co_filename in files else None

    sys.settrace(enter)
    try:
        yield seen
    finally:
        sys.settrace(None)


def files_of(parts):
    """The modules of parts of the package, each a file or a folder of it."""
    places = [PACKAGE / part for part in parts]
    return sorted(
        path for place in places for path in (place.rglob("*.py") if place.is_dir() else [place])
    )


def lines_of(parts):
    """The lines of the functions of parts of the package; what runs while a module is imported does
    not count.
    """
    return {
        (str(path), line)
        for path in files_of(parts)
        for line in _lines_of(compile(path.read_text(), str(path), "exec"))
    }


def _lines_of(code):
    if (
        code.co_flags & 0x2
        # CO_NEWLOCALS: a function; neither a module nor, in this package, a class with lines of its
        # own
    ):
        yield from (
            line
            for _, line in dis.findlinestarts(code)
            if line is not None and line != code.co_firstlineno
        )
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _lines_of(constant)


def changed_text(text, chance, marks):
    """A text with a few characters left out, doubled, swapped, or put in."""
    letters = list(text)
    for _ in range(chance.choice([1, 1, 2, 5])):
        if not letters:
            break
        at = chance.randrange(len(letters))
        match chance.randrange(4):
            case 0:
                del letters[at]
            case 1:
                letters.insert(at, chance.choice(marks))
            case 2:
                other = chance.randrange(len(letters))
                letters[at], letters[other] = letters[other], letters[at]
            case _:
                start = chance.randrange(len(letters))
                letters[at:at] = letters[start : start + chance.randrange(1, 12)]
    return "".join(letters)


def changed_bytes(whole, chance):
    """One to eight bits flipped, a stretch overwritten or left out, or the end cut off."""
    if not whole:
        return whole
    changed, at = bytearray(whole), chance.randrange(len(whole))
    match chance.randrange(8):
        case 0:
            return whole[:at]
        case 1:
            del changed[at : at + chance.randrange(1, 64)]
        case 2:
            changed[at : at + 4] = chance.choice(
                [b"\xff\xff\xff\xff", b"\x00\x00\x00\x00", b"\x7f\xff\xff\xff", chance.randbytes(4)]
            )
        case _:
            for _ in range(chance.choice([1, 1, 1, 2, 8])):
                changed[chance.randrange(len(changed))] ^= 1 << chance.randrange(8)
    return bytes(changed)


Way = tuple[str | int, ...]


def ways(tree, here=()):
    """The places in a document."""
    yield here
    for key, value in (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree)
        if isinstance(tree, list)
        else ()
    ):
        yield from ways(value, (*here, key))


def at(tree, way):
    for step in way:
        tree = tree[step]
    return tree


def changed_tree(tree, chance, value, part):
    """Change a document at one place: left out, doubled, renamed, replaced by a hostile value
    (given the old one) or by some of `part`.
    """
    places = [way for way in ways(tree) if way]
    if not places:
        return
    place = chance.choice(places)
    holder, key = at(tree, place[:-1]), place[-1]
    match chance.randrange(6):
        case 0:
            del holder[key]
        case 1 | 2:
            holder[key] = value(holder[key])
        case 3:
            holder[key] = deepcopy(at(part, chance.choice(list(ways(part)))))
        case 4 if isinstance(holder, dict):
            holder[chance.choice([changed_text(str(key), chance, "abcxyz_./"), str(value(""))])] = (
                holder.pop(key)
            )
        case _ if isinstance(holder, list):
            holder.append(holder[int(key)])
        case _:
            holder[str(value(""))] = value(holder[key])
