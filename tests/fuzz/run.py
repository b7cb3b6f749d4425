"""Tries what strangers may write: `python tests/fuzz/run.py COUNT [SEED [TARGET ...]]` prints a
table and ends with 1 at a fault.

COUNT is that of the targets that are named. Where none is, it is that of expressions: the others
take longer for each, and are tried less often (`TARGETS`). Ctrl-C ends it, and what was found so
far is printed.
"""

import signal
import sys
import tempfile
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

import documents
import drafts
import edits
import exports
import expressions
import forged
import readers
import small
import specs
import structures
import studies
import tables
import words
from driver import explore

TARGETS = (
    (expressions.TARGET, 1),
    (readers.TARGET, 10),
    *((target, 20) for target in readers.BINARY),
    (small.TARGET, 20),
    (tables.TARGET, 2),
    (documents.TARGET, 10),
    (specs.TARGET, 20),
    (structures.TARGET, 20),
    (structures.DAMAGED, 10),
    (drafts.TARGET, 100),
    (exports.EXPORTS, 100),
    (words.TARGET, 10),
    (forged.TARGET, 1),
    (exports.FREE_TEXTS, 10),
    (specs.RUNS, 400),
    (studies.FOLDERS, 200),
    (studies.RUNS, 50),
    (edits.TARGET, 400),
)
"""What is tried, and one in how many of COUNT: a spec takes fifty times as long as an expression, a
run a thousand times.
"""

IN_MEMORY = Path("/dev/shm")
"""Where files need no disk, if there is such a place."""


def line_of(target, found):
    tried = found.outcomes.total()
    past = sum(found.outcomes[outcome] for outcome in target.past)
    others = ", ".join(f"{count} {outcome}" for outcome, count in sorted(found.outcomes.items()))
    return (
        f"| {target.name} | {tried} | {past / max(tried, 1):.0%} | {others} | "
        f"{found.outcomes['FAULT']} |"
    )


def told(words):
    print(words, file=sys.stderr, flush=True)


def main(count, seed, names=()):
    """Try all targets, or those named; 1 where one of them is at fault."""
    warnings.simplefilter("ignore")
    # a shell that starts this in the background has it ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    faults = []
    print(
        "| what | tried | past the syntax | outcomes | faults |\n|---|---:|---:|---|---:|",
        flush=True,
    )
    for target, share in TARGETS:
        if names and target.name not in names:
            continue
        with TemporaryDirectory(dir=IN_MEMORY if IN_MEMORY.is_dir() else None) as folder:
            tempfile.tempdir = folder  # of what the program itself makes
            found = explore(
                target, count if names else -(-count // share), seed, Path(folder), tell=told
            )
        faults += found.faults
        print(line_of(target, found), flush=True)
        if found.interrupted:
            told("interrupted")
            break
    print(*faults, sep="\n")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 16, sys.argv[3:]))
