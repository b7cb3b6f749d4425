"""The result files of a run: one JSON document of everything but arrays, and a labelled dataset for
each array.

Every `write_*` makes a whole file or none (WriteError), with bytes that depend on the arguments
only. Every `read_*` raises DataError, naming the file, for one that is missing, damaged, of another
kind or of another major format, that holds what the format does not know, names or values that it
does not allow, a model that cannot be evaluated, or other values than were written; `unverified`
accepts the last, and `warn` is told of it, and of files without a checksum.

`units` of `write_segmentation` and `write_fit` are those of `units_of(dataset)`: the types written
there do not know them. A new major format is refused by older programs, a new minor only adds
fields. Format 3.0 is the first that was released; in 3.1 rows of a segment that follow each other
are two numbers; since 3.2 short arrays of all members of a list lie in one dataset, where up to 200
members had a dataset each; since 3.3 a segment begins with the numbers of its chosen terms. A
checksum takes arrays in the order in which the document first refers to them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar

import h5py
import numpy as np

from mapmore_cli.domain.arrays import LONG
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import SegmentedCurve
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult, Validation
from mapmore_cli.modelling.soundness import unsound
from mapmore_cli.storage.artefacts.decoding import Decoder
from mapmore_cli.storage.artefacts.hdf5 import (
    RATIO,
    ROOM,
    Waiting,
    add_to_hash,
    address_of,
    as_link,
    interrupted_later,
    look_over,
    put_arrays,
    put_text,
    root_text,
    steady,
    take_array,
    take_document,
)
from mapmore_cli.storage.artefacts.schema import (
    ARRAY,
    Invalid,
    Numbers,
    Reference,
    SegmentationFile,
    Units,
    encoded,
)
from mapmore_cli.storage.atomic import replacing
from mapmore_cli.storage.run_record import refuse_newer

FORMAT_VERSION = "3.3"

CHECKSUM = "checksum"
"""Attribute of the root: SHA-256 (hexadecimal) of all arrays and of the document."""

_ALTERED = "its values are not those that were written: the checksum does not match"
_GIVE_OURS = "give a file out of a run folder, as runs/NAME/model.h5"
_GET_ANOTHER = "get a fresh copy, or make it again with `mapmore run CONFIG`"

_as_written: dict[tuple[int, ...], str] = {}
"""Checksums of the files that this process wrote, or found to be as they were written, by their
marks: of a long one, it is not computed again.
"""

_latest: dict[tuple[int, ...], Any] = {}
"""The records of the files that this process wrote or read last, by their marks."""

REMEMBERED = 6

Warn = Callable[[str], None]
T = TypeVar("T")
NO_UNITS: Units = {}


@dataclass(frozen=True)
class FileKind(Generic[T]):
    """A kind of file: its name in the attribute `kind`, the stage that makes it, and the type of
    what it holds.

    `fault` says why a record cannot be used, or None. `ratio` bounds what a file unpacks to.
    """

    name: str
    stage: str
    type: type[T]
    fault: Callable[[Any], str | None] = lambda _record: None
    ratio: int = RATIO

    def write(
        self, path: Path, record: T, units: Units = NO_UNITS, provenance: Units = NO_UNITS
    ) -> None:
        """Write `record`; `units` are those that it does not know itself. The bytes depend on the
        arguments only.

        Raises WriteError where the disk is full.
        """
        digest = hashlib.sha256()
        about = {"kind": self.name, "format_version": FORMAT_VERSION, "creator": "mapmore"}
        with replacing(path) as place, interrupted_later(), steady(place.fileno()) as file:
            arrays: list[Waiting] = []

            def put(path: str, value: Numbers, *label: str) -> Reference:
                value.setflags(write=False)  # a later stage may be given the record
                arrays.append(Waiting({ARRAY: path}, value, label))
                return arrays[-1].reference

            content = encoded(record, self.type, put, units)
            put_arrays(file, arrays, digest)
            document = json.dumps(content, ensure_ascii=False, allow_nan=False)
            put_text(file, "document", document, "everything but arrays, as JSON")
            for name, text in provenance.items():
                put_text(file, f"provenance/{name}", text, "where the file comes from")
            digest.update(document.encode())
            file.attrs.update(about | {CHECKSUM: digest.hexdigest()})
        mark = _mark(path)
        _as_written[mark] = digest.hexdigest()
        # a reader's arrays are contiguous, on which the last digit of a sum may depend
        if mark[-1] < ROOM and all(array.value.flags.c_contiguous for array in arrays):
            _keep(mark, record)

    def read(self, path: Path, warn: Warn = lambda _message: None, unverified: bool = False) -> T:
        """Return the record in a file; `warn` is told where nothing says that it is as it was
        written.

        Raises DataError as the module says, for a checksum that does not match only where it may
        not be `unverified`.
        """
        with _opened_file(path) as (file, kind, version):
            if kind != self.name:
                raise DataError(
                    f"{path}: is a {kind} file, not a {self.name} file",
                    f"give a file that `mapmore {self.stage}` wrote",
                )
            record, doubt = self._record(
                file, path.stat().st_size, version not in ("3.0", "3.1", "3.2", FORMAT_VERSION)
            )
            if doubt == _ALTERED and not unverified:
                raise DataError(
                    f"{path}: {_ALTERED}", f"{_GET_ANOTHER}; `--unverified` reads it all the same"
                )
            if fault := self.fault(record):
                raise Invalid(self.name, fault)
        if doubt:
            warn(f"{path}: {doubt}")
        return record

    def latest(self, path: Path) -> T:
        """Return the record in a file; the one in memory if this process wrote that file or read it
        of late. Its arrays are read-only. Raises as `read`.
        """
        mark = _mark(path) if path.is_file() else ()
        record: T = _latest.pop(mark) if mark in _latest else self.read(path)
        _keep(mark, record)
        return record

    def _record(self, file: h5py.File, size: int, newer: bool) -> tuple[T, str]:
        """Return what a file holds, and why its values may not be those that were written."""
        look_over(file, size, self.ratio)
        digest, (text, document) = hashlib.sha256(), take_document(file)
        mark = _mark(Path(file.filename))
        known = size > LONG and mark in _as_written
        once: dict[int | None, str] = {}
        # one map for all arrays: each keeps a file open
        mapped = cache(lambda: np.memmap(file.filename, np.uint8, "r"))

        @cache
        def take(path: str, dtype: str, ndim: int) -> Numbers:
            address = address_of(file, path)
            if other := once.pop(address, None):
                digest.update(as_link(path, other))
                return take(other, dtype, ndim)
            values = take_array(file, path, dtype, ndim, mapped)
            if not known:
                add_to_hash(digest, path, values, dtype)
            once[address] = path
            return values

        record: T = Decoder(take, newer).value(document, self.type, "", (), {})
        digest.update(text.encode())
        if CHECKSUM not in file.attrs:
            return (
                record,
                "has no checksum: nothing shows whether its values are those that were written",
            )
        if newer:
            return record, "is of a newer format: its checksum cannot be verified here"
        found = _as_written[mark] if known else digest.hexdigest()
        if root_text(file, CHECKSUM) != found:
            return record, _ALTERED
        _as_written[mark] = found
        return record, ""


DATASET_FILE = FileKind("dataset", "ingest", Dataset)
SEGMENTATION_FILE = FileKind("segmentation", "segment", SegmentationFile)
FIT_FILE = FileKind("fit", "fit", FitResult)
MODEL_FILE = FileKind("model", "fuse", Model, unsound, 0)
VALIDATION_FILE = FileKind("validation", "validate", Validation)
KINDS: tuple[FileKind[Any], ...] = (
    DATASET_FILE,
    SEGMENTATION_FILE,
    FIT_FILE,
    MODEL_FILE,
    VALIDATION_FILE,
)


def kind_of(path: Path) -> str:
    """`dataset`, `segmentation`, `fit`, `model` or `validation`; DataError for anything else."""
    with _opened_file(path) as (_, kind, _version):
        return kind


def checksum_of(path: Path, anew: bool = False) -> str | None:
    """Return the checksum of a file of ours that holds what was written, computed `anew` where this
    process knows it; None of any other.
    """
    mark = _mark(path)
    if anew:
        _as_written.pop(mark, None)
    with suppress(DataError):
        if mark not in _as_written:
            name = kind_of(path)
            next(kind for kind in KINDS if kind.name == name).read(path)
    return _as_written.get(mark)


write_dataset, read_dataset = DATASET_FILE.write, DATASET_FILE.read
write_fit, read_fit = FIT_FILE.write, FIT_FILE.read
write_validation, read_validation = VALIDATION_FILE.write, VALIDATION_FILE.read
read_model = MODEL_FILE.read


def write_model(path: Path, model: Model, provenance: Units = NO_UNITS) -> None:
    """Write a model that stands alone; `provenance` may hold texts of any length, as the resolved
    spec.
    """
    MODEL_FILE.write(path, model, provenance=provenance)


def write_segmentation(path: Path, curves: tuple[SegmentedCurve, ...], *units: Units) -> None:
    """Write where the training curves are cut: boundaries and row numbers, no samples."""
    SEGMENTATION_FILE.write(path, SegmentationFile(tuple(curves)), *units)


def read_segmentation(
    path: Path, warn: Warn = lambda _message: None, unverified: bool = False
) -> tuple[SegmentedCurve, ...]:
    """Read where the training curves are cut."""
    return SEGMENTATION_FILE.read(path, warn, unverified).curves


def _keep(mark: tuple[int, ...], record: object) -> None:
    """Keep a record in memory, and forget the oldest one of too many."""
    _latest[mark] = record
    while len(_latest) > REMEMBERED:
        del _latest[next(iter(_latest))]


def _mark(path: Path) -> tuple[int, ...]:
    """Return what changes where a file is replaced or written to."""
    state = path.stat()
    return state.st_dev, state.st_ino, state.st_mtime_ns, state.st_size


@contextmanager
def _opened_file(path: Path) -> Iterator[tuple[h5py.File, str, str]]:
    """Open a file for reading, with its kind and version; what is invalid in it, and no file of
    ours, is a DataError.
    """
    if not path.is_file():
        what = "is a folder or a special file, not a file" if path.exists() else "no such file"
        raise DataError(f"{path}: {what}", "`mapmore run CONFIG` makes it")
    try:
        file = h5py.File(path, "r")
    except OSError as fault:
        raise DataError(
            f"{path}: cannot be read ({str(fault).partition(chr(10))[0]})", _GIVE_OURS
        ) from fault
    kind: str | None = "file"
    try:
        with file:
            kind, version = root_text(file, "kind"), root_text(file, "format_version")
            if version is None or kind not in {known.name for known in KINDS}:
                raise DataError(f"{path}: is an HDF5 file, but not one of mapmore's", _GIVE_OURS)
            refuse_newer(path, version, FORMAT_VERSION)
            if int(version.split(".")[0]) < int(FORMAT_VERSION[0]):
                raise DataError(
                    f"{path}: is of the format {version}, from before the first release",
                    _GET_ANOTHER,
                )
            yield file, str(kind), version
    except Invalid as fault:
        raise DataError(f"{path}: is not a valid {kind}: {fault}", _GET_ANOTHER) from fault
