"""Result files: whole ones of every kind, changed as trees of groups, arrays and attributes, then
read, shown and used.

The files are those of examples and of random records. A change renames, removes, adds, or gives
another type, shape or value; HDF5 itself is never damaged (`artefacts.py` does that). A file is
refused with exit 4, told, or every value read is the one that was written. It is read once more as
`--unverified` does, as if the checksum had been made anew: what is then shown, computed or exported
is refused or done, and no internal fault.
"""

from __future__ import annotations

import random
import sys
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from driver import Fault, Target, refused
from hypothesis import HealthCheck, Phase, given, settings

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "storage"))

from stored_records import same
from test_artefacts import KINDS, examples
from used_files import use

from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.foreign import printable

RANDOM_RECORDS = 25  # of every kind
LONGEST_MESSAGE = 1000
ALTERED = "checksum does not match"

WORDS = (
    *(
        "",
        "strain",
        "pressure",
        "1",
        "saturate",
        "zero",
        "none",
        "levels",
        "x" * 5000,
        "\x1b[2J",
        "a\nb",
        "=1+1",
        "é",
        "..",
        "a/b",
        "%2F",
    ),
    *(
        "strain^2",
        "exp(strain",
        "force[k-1]",
        "slow(pressure, 0.5)",
        "strain[k-99999999999]",
        "unit_square",
        "max_terms",
        "converged",
    ),
)
VALUES = (
    0,
    1,
    -1,
    2,
    0.5,
    -0.0,
    1e-300,
    1e300,
    -1e308,
    5e-324,
    np.nan,
    np.inf,
    -np.inf,
    2**31,
    2**53,
    2**62,
    1e9,
)
TYPES = ("<f4", ">f8", "<f2", "<i8", "<i4", "|i1", "<u8", "|u1", "|b1", "<c16", "S8", "V3")
PACKINGS = (
    {"compression": "gzip"},
    {"compression": "lzf"},
    {"shuffle": True},
    {"fletcher32": True},
)
VERSIONS = (
    "1.0",
    "1.1",
    "1.2",
    "2.0",
    "2.1",
    "2.9",
    "3.0",
    "99",
    "",
    "two",
    "2",
    "2.1.1",
    "-1.0",
    "1e3",
    "\u0662.1",
    2.1,
    2,
)


Place = tuple[str, str]
"""A group or a dataset, and an attribute of it or nothing."""


@dataclass(frozen=True)
class Whole:
    kind: str
    content: bytes
    record: Any
    places: tuple[Place, ...]


@cache
def whole_files():
    place, made, found = Path(_folder[0]) / "whole.h5", list(examples().items()), list[Whole]()
    for kind, (_, _, strategy) in KINDS.items():
        made += [(kind, record) for record in _drawn(strategy)[-RANDOM_RECORDS:]]
    for kind, record in made:
        KINDS[kind][0](place, record)
        found.append(_whole(place, kind, record))
    return tuple(found)


_folder = ["."]


def _whole(place, kind, record):
    with h5py.File(place, "r") as file:
        return Whole(kind, place.read_bytes(), record, tuple(places(file)))


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


def places(file):
    """Every group, dataset and attribute but the root: its path (of an attribute, that of its
    holder) and an attribute's name.
    """
    found = [("/", name) for name in file.attrs]

    def note(path, item):
        found.append((path, ""))
        found.extend((path, name) for name in item.attrs if name not in ("unit", "description"))

    file.visititems(note)
    return found


def changed(file, known, chance):
    """Change a file at one of its places; a change that HDF5 refuses is none."""
    path, attribute = chance.choice(known)
    with suppress(
        ValueError, TypeError, KeyError, OSError, RuntimeError, OverflowError, AttributeError
    ):
        if path == "/" and attribute == "format_version":
            file.attrs[attribute] = chance.choice(VERSIONS)
        elif attribute:
            _change_attribute(file[path].attrs, attribute, chance)
        elif chance.random() < 0.3:
            _change_tree(
                file, path, chance.choice([place for place, name in known if not name]), chance
            )
        elif isinstance(file[path], h5py.Dataset):
            _change_dataset(file, path, chance)
        else:
            _change_group(file, file[path], chance)


def _change_attribute(attributes, name, chance):
    match chance.randrange(4):
        case 0:
            del attributes[name]
        case 1:
            attributes[name] = chance.choice(WORDS)
        case 2:
            attributes[name] = chance.choice(
                [*VALUES, np.zeros(3), np.zeros((2, 2)), b"\xff\xfe", h5py.Empty("f8"), [1, 2]]
            )
        case _:
            value = attributes[name]
            listed = (
                list(value)
                if isinstance(value, np.ndarray) and value.dtype.kind == "O"
                else [value]
            )
            chance.shuffle(listed)
            attributes[name] = chance.choice(
                [listed[:-1], listed * 2, [*listed, chance.choice(WORDS)], listed]
            )


def _change_tree(file, path, other, chance):
    """Remove, rename, exchange, copy or link a group or a dataset, with what stands at another
    place.
    """
    parent = file[path].parent
    name = chance.choice([*WORDS[1:7], "000", "001", "002", "999", f"{path.rsplit('/', 1)[-1]}x"])
    match chance.randrange(7):
        case 0 | 1:
            del file[path]
        case 2:
            parent.move(path.rsplit("/", 1)[-1], name)
        case 3:
            file.copy(file[other], parent, name=name)
        case 4:
            del file[path]
            file.copy(file[other], file, name=path) if other in file else file.create_group(path)
        case 5:
            parent[name] = chance.choice(
                [
                    h5py.SoftLink(f"/{other}"),
                    h5py.ExternalLink("other.h5", "/"),
                    file[other],
                    file["/"],
                ]
            )
        case _:
            del file[path]
            file[path] = chance.choice(
                [h5py.SoftLink("/nowhere"), h5py.SoftLink(f"/{path}"), np.dtype("<f8")]
            )


def _change_group(file, group, chance):
    """Put something more into a group, or a dataset in its place."""
    name = chance.choice([*WORDS[1:7], "000", "001", "more"])
    match chance.randrange(4):
        case 0:
            group.create_group(name)
        case 1:
            group[name] = chance.choice([np.zeros(3), "text", 1.5, np.zeros((2, 2)), np.zeros(0)])
        case 2:
            place = group.name
            del file[place]
            file[place] = np.zeros(2)
        case _:
            for number in range(chance.choice([1, 150])):
                group.attrs[f"more{number}"] = number


def _change_dataset(file, path, chance):
    """Give a dataset other values, another type or another shape; what is said about it stays."""
    old = file[path]
    values = old.asstr()[()] if h5py.check_string_dtype(old.dtype) else old[()]
    attributes = dict(old.attrs)
    del file[path]
    match chance.randrange(8):
        case 0:
            file[path] = (
                np.asarray(values).astype(chance.choice(TYPES))
                if not _is_text(values)
                else np.zeros(np.shape(values))
            )
        case 1:
            file.create_dataset(
                path,
                data=_reshaped(values, chance),
                dtype=h5py.string_dtype() if _is_text(values) else None,
            )
        case 2:
            file[path] = chance.choice(
                [
                    h5py.Empty("f8"),
                    "text",
                    1.5,
                    np.zeros((0, 2)),
                    b"\xff",
                    ["a", "b"],
                    np.zeros(1, "i4,f8"),
                ]
            )
        case 3 if np.ndim(values):
            text = h5py.string_dtype() if _is_text(values) else None
            file.create_dataset(
                path, data=values, chunks=True, dtype=text, **chance.choice(PACKINGS)
            )
        case _:
            file.create_dataset(
                path,
                data=_revalued(values, chance),
                dtype=h5py.string_dtype() if _is_text(values) else None,
            )
    file[path].attrs.update(attributes)


def _is_text(values):
    return isinstance(values, str) or (
        isinstance(values, np.ndarray) and values.dtype.kind in "OSU"
    )


def _reshaped(values, chance):
    array = np.asarray(values)
    flat = array.reshape(-1)
    one = flat[:1].reshape(()) if flat.size else flat
    return chance.choice(
        [flat[:-1], flat[:0], np.concatenate([flat, flat]), one, array[np.newaxis], array.T]
    )


def _revalued(values, chance):
    """The values with one to all of them replaced, exchanged or reversed, in their type."""
    array = np.array(values)
    flat, made = array.reshape(-1), chance.choice(WORDS if _is_text(values) else VALUES)
    if not flat.size:
        return np.array([made])
    match chance.randrange(4):
        case 0:
            flat[:] = flat[::-1].copy()
        case 1:
            flat[:] = _of_type(made, flat.dtype)
        case 2:
            flat[chance.randrange(flat.size)] = flat[chance.randrange(flat.size)]
        case _:
            flat[chance.randrange(flat.size)] = _of_type(made, flat.dtype)
    return flat.reshape(array.shape)


def _of_type(value, dtype):
    return int(value) if dtype.kind in "iu" and np.isfinite(value) and abs(value) < 2**62 else value


def attempt(chance, number, folder):
    """Change a file and read it; then read it without its checksum, and show and use what it
    holds.
    """
    whole = chance.choice(whole_files())
    kind, record, path = whole.kind, whole.record, folder / "file.h5"
    path.write_bytes(whole.content)
    with h5py.File(path, "r+") as file:
        for change in range(chance.choice([1, 1, 1, 2, 4])):
            changed(file, places(file) if change else whole.places, chance)
    _, read, _ = KINDS[kind]
    told = []
    said = ""
    try:
        found = read(path, told.append)
    except DataError as error:
        said = _checked_words(error, path)
        outcome = refused(error)
    else:
        outcome = "nothing altered" if same(found, record) else "told" if told else "MISSED"
    if outcome == "MISSED":
        raise Fault(f"{kind}: another value without a word")
    if outcome.startswith("refused") and ALTERED not in said and number % 10:
        # for the same reason: reading it once more would show nothing else
        return f"{outcome}, unverified too"
    try:
        use(path, chance)
    except MapmoreError:
        return f"{outcome}, unverified too" if outcome.startswith("refused") else outcome
    return f"{outcome}, unverified used" if outcome.startswith("refused") else outcome


def _checked_words(error, path):
    """What is said: it names the file, is of a bearable length, and sends no escapes to a
    terminal.
    """
    said = printable(str(error))  # as it reaches a terminal
    if error.exit_code != 4 or str(path) not in said or len(said) > LONGEST_MESSAGE:
        raise Fault(f"a message as no user wants it: {said[:300]!r}")
    return said


def warm(folder):
    _folder[0] = str(folder)
    chance = random.Random(1)
    for whole in whole_files()[:5]:
        (folder / "file.h5").write_bytes(whole.content)
        use(folder / "file.h5", chance)


TARGET = Target(
    "artefacts",
    attempt,
    ("storage/artefacts",),
    past=(
        "nothing altered",
        "told",
        "refused (exit 4), unverified used",
        "refused (exit 4), unverified too",
    ),
    traced=50,
    warm=warm,
)
