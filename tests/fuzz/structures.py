"""Result files: whole ones of every kind, changed as trees of groups, arrays and attributes, or in
their bits; then read, shown and used.

The files are those of examples and of random records. A file is refused with exit 4, told, or every
value read is the one that was written. One that was changed as a tree is read once more as
`--unverified` does, as if the checksum had been made anew: what is then shown, computed or exported
is refused or done, and no internal fault.
"""

from __future__ import annotations

import json
import random
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from driver import Fault, Target, changed_bytes, changed_tree, refused
from hypothesis import HealthCheck, Phase, given, settings

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "storage"))

from stored_records import same
from test_artefacts import KINDS, examples
from used_files import use

from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.foreign import printable
from mapmore_cli.storage.artefacts.hdf5 import put_text

RANDOM_RECORDS = 25  # of every kind
LONGEST_MESSAGE = 1000
ALTERED = "checksum does not match"

WORDS = ["strain", "pressure", "1", "saturate", "none", "000", "001", "002", "999", "more"]
STRANGE = ["", "x" * 5000, "\x1b[2J", "a\nb", "=1+1", "é", "..", "a/b", "strain^2", "exp(strain"]
STRANGE += ["force[k-1]", "slow(pressure, 0.5)", "strain[k-99999999999]", "max_terms", "converged"]
NUMBERS = [0, 1, -1, 2, 0.5, -0.0, 1e-300, 1e300, -1e308, 5e-324, 2**31, 2**53, 2**62, 1e9]
NUMBERS += [np.nan, np.inf, -np.inf]
TYPES = ["<f4", ">f8", "<f2", "<i8", "<i4", "|i1", "<u8", "|u1", "|b1", "<c16", "S8", "V3"]
PACKINGS = [{name: True} for name in ("shuffle", "fletcher32")]
PACKINGS += [{"compression": name} for name in ("gzip", "lzf")]
VERSIONS = ["1.0", "2.1", "2.9", "3.0", "99", "", "two", "2", "2.1.1", "-1.0", "1e3", "\u0662.1", 2]


class Whole(NamedTuple):
    kind: str
    content: bytes
    record: Any


def written(folder, made):
    """Files of some records, by their kinds."""
    place, files = folder / "whole.h5", []
    for kind, record in made:
        KINDS[kind][0](place, record)
        files.append(Whole(kind, place.read_bytes(), record))
    return files


@cache
def example_files(folder):
    return written(folder, examples().items())


@cache
def whole_files(folder):
    drawn = {kind: _drawn(strategy)[-RANDOM_RECORDS:] for kind, (_, _, strategy) in KINDS.items()}
    random_files = written(folder, [(kind, one) for kind, made in drawn.items() for one in made])
    return example_files(folder) + random_files


def _drawn(strategy):
    """Random records, the same in every process."""
    records = []

    @settings(
        max_examples=3 * RANDOM_RECORDS,
        phases=[Phase.generate],
        derandomize=True,
        database=None,
        suppress_health_check=[*HealthCheck],
    )
    @given(strategy)
    def collect(record):
        records.append(record)

    collect()
    return records


def changed(file, chance):
    """Change a file at one place; a change that HDF5 refuses is none."""
    places = ["/"]
    file.visit(places.append)
    path = chance.choice(places)
    attributes = [name for name in file[path].attrs if name not in ("unit", "description")]
    with suppress(
        ValueError, TypeError, KeyError, OSError, RuntimeError, OverflowError, AttributeError
    ):
        if path == "/" or (attributes and chance.random() < 0.3):
            _change_attribute(file[path].attrs, chance.choice(attributes), chance)
        elif chance.random() < 0.3:
            _change_tree(file, path, chance.choice(places), chance)
        elif isinstance(file[path], h5py.Group):
            _change_group(file[path], chance)
        elif path == "document":
            _change_document(file, chance)
        else:
            _change_array(file, path, chance)


def _change_attribute(attributes, name, chance):
    others = [*STRANGE, *NUMBERS, np.zeros(3), np.zeros((2, 2)), b"\xff\xfe", h5py.Empty("f8")]
    match chance.randrange(3):
        case 0:
            del attributes[name]
        case 1 if name == "format_version":
            attributes[name] = chance.choice(VERSIONS)
        case _:
            attributes[name] = chance.choice([*others, ["x", "y"]])


def _change_tree(file, path, other, chance):
    """Remove, rename, exchange, copy or link a group or a dataset, with what stands at another
    place.
    """
    name = chance.choice(WORDS)
    links = [h5py.SoftLink(f"/{other}"), h5py.ExternalLink("other.h5", "/"), file[other]]
    match chance.randrange(5):
        case 0:
            file.move(path, f"{path}{name}")
        case 1:
            file.copy(file[other], file[path].parent, name=name)
        case 2:
            file[path].parent[name] = chance.choice(links)
        case number:
            del file[path]
            if number == 3:
                file[path] = chance.choice([*links, h5py.SoftLink("/nowhere"), np.dtype("<f8")])


def _change_group(group, chance):
    """Put something more into a group, or a dataset in its place."""
    name, place, file = chance.choice(WORDS), group.name, group.file
    match chance.randrange(4):
        case 0:
            group.create_group(name)
        case 1:
            group[name] = chance.choice([np.zeros(3), "text", 1.5, np.zeros((2, 2)), np.zeros(0)])
        case 2:
            del file[place]
            file[place] = np.zeros(2)
        case _:
            for number in range(chance.choice([1, 150])):
                group.attrs[f"more{number}"] = number


def _change_document(file, chance):
    """Change the document as a tree; `put_text` stores it as the writer does."""
    document = json.loads(file["document"][()])
    values = [*WORDS, *STRANGE, *NUMBERS, None, True, {}, []]
    changed_tree(document, chance, lambda _: chance.choice(values), document)
    del file["document"]
    put_text(file, "document", json.dumps(document), "everything but arrays, as JSON")


def _change_array(file, path, chance):
    """Give an array other values, another type or another shape; what is said about it stays."""
    attributes, array = dict(file[path].attrs), np.array(file[path][()])
    flat, packing = array.reshape(-1), {}
    if array.dtype.kind in "fiu" and flat.size and chance.random() < 0.5:
        number = chance.choice(NUMBERS)
        whole = number if np.isfinite(number) and abs(number) < 2**62 else 7
        flat[chance.randrange(flat.size)] = number if array.dtype.kind == "f" else int(whole)
    else:
        shapes = [flat[:-1], flat[:0], np.concatenate([flat, flat]), flat[:1].reshape(-1, 1)]
        others = [h5py.Empty("f8"), "text", 1.5, np.zeros((0, 2)), b"\xff", np.zeros(1, "i4,f8")]
        kind = chance.choice(["type", "shape", "other", "packing"])
        if kind == "type":
            array = array.astype(chance.choice(TYPES))
        elif kind == "packing":
            packing = {"chunks": True, **chance.choice(PACKINGS)}
        else:
            array = chance.choice(shapes if kind == "shape" else others)
    del file[path]
    file.create_dataset(path, data=array, **packing)
    file[path].attrs.update(attributes)


def outcome_of(whole, path):
    """What becomes of a changed file where it is read, and what is said of it."""
    told, read = [], KINDS[whole.kind][1]
    try:
        record = read(path, told.append)
    except DataError as error:
        said = printable(str(error))  # as it reaches a terminal
        if error.exit_code != 4 or str(path) not in said or len(said) > LONGEST_MESSAGE:
            raise Fault(f"a message as no user wants it: {said[:300]!r}") from error
        return refused(error), said
    if same(record, whole.record):
        return "nothing altered", ""
    if not told:
        raise Fault(f"{whole.kind}: another value without a word")
    return "told", ""


def attempt(chance, number, folder):
    """Change a file and read it; then read it without its checksum, and show and use what it
    holds.
    """
    whole, path = chance.choice(whole_files(folder)), folder / "file.h5"
    path.write_bytes(whole.content)
    with h5py.File(path, "r+") as file:
        for _ in range(chance.choice([1, 1, 1, 2, 4])):
            changed(file, chance)
    outcome, said = outcome_of(whole, path)
    again = outcome.startswith("refused")
    if again and ALTERED not in said and number % 10:
        # for the same reason: reading it once more would show nothing else
        return f"{outcome}, unverified too"
    try:
        use(path, chance)
    except MapmoreError:
        return f"{outcome}, unverified too" if again else outcome
    return f"{outcome}, unverified used" if again else outcome


def damaged(chance, _number, folder):
    """Flip bits of a file, or cut it off, and read it."""
    whole, path = chance.choice(example_files(folder)), folder / "file.h5"
    path.write_bytes(changed_bytes(whole.content, chance))
    return f"{whole.kind} {outcome_of(whole, path)[0]}"


def warm(folder):
    chance = random.Random(1)
    whole_files(folder)
    for whole in example_files(folder):
        (folder / "file.h5").write_bytes(whole.content)
        use(folder / "file.h5", chance)


TARGET = Target(
    "artefacts",
    attempt,
    past=(
        "nothing altered",
        "told",
        "refused (exit 4), unverified used",
        "refused (exit 4), unverified too",
    ),
    warm=warm,
)
DAMAGED = Target("damaged files", damaged, library="libhdf5", warm=example_files)
