"""Flips bits of every kind of result file, cuts them off, and counts what becomes of them: `python tests/fuzz/artefacts.py COUNT [SEED]`.

Each change is refused (DataError), told (a warning), or alters no value that is read. Where libhdf5 itself crashes or hangs is counted;
anything else is printed and ends with 1.
"""

from __future__ import annotations

import os
import random
import signal
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "storage"))

from stored_records import same
from test_artefacts import KINDS, examples

from mapmore_cli.domain.errors import DataError


def damaged(whole: bytes, chance: random.Random) -> bytes:
    """One to eight bits flipped, or the file cut off."""
    if chance.random() < 0.1:
        return whole[: chance.randrange(len(whole))]
    changed = bytearray(whole)
    for _ in range(chance.choice([1, 1, 1, 2, 8])):
        changed[chance.randrange(len(whole))] ^= 1 << chance.randrange(8)
    return bytes(changed)


OUTCOMES = ("nothing altered", "refused", "told", "MISSED", "FAULT of the program")
LONGEST = 5  # seconds


def outcome_of(read: Callable[..., Any], path: Path, record: Any) -> int:
    """What becomes of a file, as a number of `OUTCOMES`."""
    told: list[str] = []
    try:
        found = read(path, told.append)
    except DataError:
        return 1
    except Exception:
        return 4
    return 0 if same(found, record) else 2 if told else 3


def in_a_child(read: Callable[..., Any], path: Path, record: Any) -> str:
    """The same in a process of its own: libhdf5 can crash on a damaged file, or not come back."""
    child = os.fork()
    if child == 0:
        signal.alarm(LONGEST)
        os._exit(outcome_of(read, path, record))
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        return "libhdf5 hangs" if os.WTERMSIG(status) == signal.SIGALRM else "libhdf5 crashes"
    return OUTCOMES[os.WEXITSTATUS(status)]


def main(count: int, seed: int) -> int:
    """Try `count` changes of each kind of file; 1 where one of them went unnoticed."""
    chance, missed = random.Random(seed), 0
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file.h5"
        for kind, record in examples().items():
            write, read, _ = KINDS[kind]
            write(path, record)
            whole, outcomes = path.read_bytes(), Counter[str]()
            for number in range(count):
                path.write_bytes(damaged(whole, chance))
                outcome = in_a_child(read, path, record)
                outcomes[outcome] += 1
                if outcome[0].isupper():
                    missed += 1
                    print(f"{kind}, change {number}: {outcome}")
            print(f"{kind}: {count} tried, " + ", ".join(f"{number} {outcome}" for outcome, number in sorted(outcomes.items())), flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 16))
