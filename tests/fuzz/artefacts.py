"""Flips bits of every kind of result file, cuts them off, and counts what becomes of them: `python
tests/fuzz/artefacts.py COUNT [SEED]`.

Each change is refused (DataError), told (a warning), or alters no value that is read. Where libhdf5
itself crashes or hangs is counted; anything else is printed and ends with 1.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from driver import Fault, Target, explore

sys.path.insert(0, str(Path(__file__).parents[1] / "storage"))

from stored_records import same
from test_artefacts import KINDS, examples

from mapmore_cli.domain.errors import DataError


def damaged(whole, chance):
    """One to eight bits flipped, or the file cut off."""
    if chance.random() < 0.1:
        return whole[: chance.randrange(len(whole))]
    changed = bytearray(whole)
    for _ in range(chance.choice([1, 1, 1, 2, 8])):
        changed[chance.randrange(len(whole))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def target(kind, record, folder):
    write, read, _ = KINDS[kind]
    path = folder / "file.h5"
    write(path, record)
    whole = path.read_bytes()

    def attempt(chance, _number, _folder):
        path.write_bytes(damaged(whole, chance))
        told = []
        try:
            found = read(path, told.append)
        except DataError:
            return "refused"
        if not same(found, record) and not told:
            raise Fault("another value without a word")
        return "nothing altered" if same(found, record) else "told"

    return Target(kind, attempt, (), library="libhdf5")


def main(count, seed):
    """Try `count` changes of each kind of file; 1 where one of them went unnoticed."""
    faults = []
    with TemporaryDirectory() as folder:
        for kind, record in examples().items():
            found = explore(target(kind, record, Path(folder)), count, seed, Path(folder), traced=0)
            faults += found.faults
            print(
                f"{kind}: {count} tried, "
                + ", ".join(f"{many} {what}" for what, many in sorted(found.outcomes.items())),
                flush=True,
            )
    print(*faults, sep="\n")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 16))
