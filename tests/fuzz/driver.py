"""Tries many inputs of one kind, each within bounds of time and memory, and counts what becomes of
them.

Input `number` of a target is made by `random.Random(f"{seed}/{name}/{number}")` alone, so a finding
can be tried again by its number. The inputs run in a fork; where one of them kills it, the next
fork goes on behind it.
"""

from __future__ import annotations

import gc
import os
import random
import resource
import signal
import time
import traceback
from collections import Counter
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path

LONGEST = 5  # seconds of one input
ROOM = 1 << 30  # bytes of memory that inputs may take beside what the program had at its start
SILENCE = 60.0  # seconds between two words of how far it is

Try = Callable[[random.Random, int, Path], str]
"""Makes an input of a chance, tries it in a folder, and says what became of it; the number is that
of the input.
"""


@dataclass(frozen=True)
class Target:
    """What is fuzzed: `name`, how one input is tried, and the outcomes that are past the syntax.

    `library` is what crashes and hangs are laid to where the input goes through foreign machine
    code; without one they are faults. `longest`: the seconds of one input. `warm` imports and makes
    what all inputs need, once, before the forks.
    """

    name: str
    attempt: Try
    past: tuple[str, ...] = ()
    library: str | None = None
    longest: int = LONGEST
    warm: Callable[[Path], object] = lambda _folder: None


@dataclass
class Findings:
    """Outcomes and how often they came, faults with the number of their input, and whether Ctrl-C
    ended it early.
    """

    outcomes: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    interrupted: bool = False


class Fault(Exception):
    """What the program may not do: raised by a target where no exception shows it."""


def explore(target, count, seed, folder, tell=lambda _words: None):
    """Try `count` inputs, or fewer where Ctrl-C ends it; `tell` how far it is."""
    findings, start, last = Findings(), 0, time.monotonic()

    def told():
        nonlocal last
        if time.monotonic() - last > SILENCE:
            last = time.monotonic()
            tried, faults = findings.outcomes.total(), findings.faults
            tell(f"{target.name}: {tried} of {count} tried, {len(faults)} faults {faults[-1:]}")

    try:
        target.warm(folder)
        while start < count:
            start = _batch(target, range(start, count), seed, folder, findings, told)
    except KeyboardInterrupt:
        findings.interrupted = True
    return findings


def _batch(target, numbers, seed, folder, findings, told):
    """Try inputs in one fork; the number of the first one that it left."""
    read, write = os.pipe()
    gc.freeze()  # what is there before the inputs is not looked through again and again
    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a word
        os.close(read)
        with os.fdopen(write, "w", encoding="utf-8", errors="replace", buffering=1) as report:
            _inputs(target, numbers, seed, folder, report)
        os._exit(0)
    os.close(write)
    done = numbers.start
    try:
        with os.fdopen(read, encoding="utf-8", errors="replace") as report:
            for line in report:
                told()
                kind, _, text = line.rstrip("\n").partition(" ")
                if kind == "fault":
                    findings.faults.append(f"{target.name} {done}: {text}")
                findings.outcomes["FAULT" if kind == "fault" else text] += 1
                done += 1
    except BaseException:  # no fork goes on alone
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        hung = number == signal.SIGVTALRM
        if target.library:
            findings.outcomes[f"{target.library} {'hangs' if hung else 'crashes'}"] += 1
        else:
            what = f"longer than {target.longest} s" if hung else f"ended by signal {number}"
            findings.faults.append(f"{target.name} {done}: {what}")
            findings.outcomes["FAULT"] += 1
        done += 1
    return done


def _inputs(target, numbers, seed, folder, report):
    """Try inputs and report what becomes of each, a line for every one."""
    # libraries reserve address space that they never use: what counts is beside what was reserved
    # at the start
    sizes = Path("/proc/self/statm")
    if sizes.exists():
        taken = int(sizes.read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + ROOM, taken + ROOM))
    for number in numbers:
        signal.setitimer(signal.ITIMER_VIRTUAL, target.longest)
        chance = random.Random(f"{seed}/{target.name}/{number}")
        try:
            print("done", target.attempt(chance, number, folder), file=report)
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
            print("fault", f"{said} ({Path(last.filename).name}:{last.lineno})", file=report)
    signal.setitimer(signal.ITIMER_VIRTUAL, 0)


def refused(error):
    return f"refused (exit {error.exit_code})"


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
