"""Read and write the result files of a run. A file holds one JSON document with everything but
arrays, and a labelled dataset for each array.

Every `write_*` writes a file completely or raises WriteError, without a partial file. The bytes
depend only on the arguments. Every `read_*` raises DataError with the name of the file in these
cases:

- The file is missing, damaged, of another kind, or of another major format.
- It has unknown fields, invalid names or invalid values, or a model that cannot be evaluated.
- Its values do not match its checksum. With `unverified=True`, `warn` is called instead. `warn` is
  also called for a file without a checksum.

The argument `units` of `write_segmentation` and `write_fit` is `units_of(dataset)`, because
segmentations and fits do not contain the units of their quantities. Older programs refuse a new
major format; a new minor format only adds fields. Format 3.0 is the first that was released. In
3.1, consecutive rows of a segment are stored as two numbers. Since 3.2, short arrays of all members
of a list are in one dataset; before, up to 200 members had one dataset each. Since 3.3, a segment
begins with the numbers of its chosen terms. A checksum includes the arrays in the order in which
the document first refers to them.
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
from mapmore_cli.domain.errors import DataError, Warn
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
from mapmore_cli.storage.inputs import note_read
from mapmore_cli.storage.run_record import refuse_newer

FORMAT_VERSION = "3.3"

CHECKSUM = "checksum"
"""Attribute of the root: SHA-256 (hexadecimal) of all arrays and of the document."""

_ALTERED = "the checksum does not match: its values have changed since the file was written"
_GIVE_OURS = "give a file from a run folder, for example runs/NAME/model.h5"
_GET_ANOTHER = "get a fresh copy, or make the file again with `mapmore run CONFIG`"

_as_written: dict[tuple[int, ...], str] = {}
"""Checksums of the files that this process wrote, or found to be unchanged, by their marks
(`_mark`), so that the checksum of a long file is not computed again.
"""

_latest: dict[tuple[int, ...], Any] = {}
"""Records of the files that this process wrote or read most recently, by their marks (`_mark`)."""

REMEMBERED = 6

T = TypeVar("T")
NO_UNITS: Units = {}


@dataclass(frozen=True)
class FileKind(Generic[T]):
    """A kind of result file.

    - `name`: value of the attribute `kind` in files of this kind.
    - `stage`: stage that writes such files.
    - `type`: type of the contents.
    - `fault`: function that returns the reason why contents cannot be used; None if they can.
    - `ratio`: largest allowed ratio of the unpacked size of a file to its size on the disk.
    """

    name: str
    stage: str
    type: type[T]
    fault: Callable[[Any], str | None] = lambda _record: None
    ratio: int = RATIO

    def write(
        self, path: Path, record: T, units: Units = NO_UNITS, provenance: Units = NO_UNITS
    ) -> None:
        """Write `record` to a file. `units` holds units of quantities that the record itself does
        not contain. The bytes depend only on the arguments.

        Raises WriteError if the disk is full.
        """
        digest = hashlib.sha256()
        about = {"kind": self.name, "format_version": FORMAT_VERSION, "creator": "mapmore"}
        with replacing(path) as place, interrupted_later(), steady(place.fileno()) as file:
            arrays: list[Waiting] = []

            def put(path: str, value: Numbers, *label: str) -> Reference:
                # a later stage may get the same array, so the array is made read-only
                value.setflags(write=False)
                arrays.append(Waiting({ARRAY: path}, value, label))
                return arrays[-1].reference

            content = encoded(record, self.type, put, units)
            put_arrays(file, arrays, digest)
            document = json.dumps(content, ensure_ascii=False)
            put_text(file, "document", document, "everything but arrays, as JSON")
            for name, text in provenance.items():
                put_text(file, f"provenance/{name}", text, "where the file comes from")
            digest.update(document.encode())
            file.attrs.update(about | {CHECKSUM: digest.hexdigest()})
        mark = _mark(path)
        _as_written[mark] = digest.hexdigest()
        # The record is kept in memory only if its arrays are contiguous, as arrays that are read
        # from a file are. Otherwise, sums over the arrays could differ in the last digit from sums
        # over the arrays in the file.
        if mark[-1] < ROOM and all(array.value.flags.c_contiguous for array in arrays):
            _keep(mark, record)

    def read(self, path: Path, warn: Warn = lambda _message: None, unverified: bool = False) -> T:
        """Return the record in a file. `warn` is called if the file has no checksum, or a checksum
        that cannot be verified here.

        Raises DataError as described in the docstring of the module. A wrong checksum raises an
        error only if `unverified` is False; otherwise, `warn` is called.
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
                    f"{path}: {_ALTERED}",
                    f"{_GET_ANOTHER}; `--unverified` reads it without this check",
                )
            if fault := self.fault(record):
                raise Invalid(self.name, fault)
        if doubt:
            warn(f"{path}: {doubt}")
        return record

    def latest(self, path: Path) -> T:
        """Return the record in a file. If this process wrote or read the file recently, the record
        is taken from memory. Its arrays are read-only. Raises the same errors as `read`.
        """
        mark = _mark(path) if path.is_file() else ()
        record: T = _latest.pop(mark) if mark in _latest else self.read(path)
        _keep(mark, record)
        return record

    def _record(self, file: h5py.File, size: int, newer: bool) -> tuple[T, str]:
        """Return the contents of a file, and a text. If the checksum of the file is right, the text
        is empty; otherwise, it says why the values may have been changed. `newer` is True if the
        file has a newer minor format than this program.
        """
        look_over(file, size, self.ratio)
        digest, (text, document) = hashlib.sha256(), take_document(file)
        mark = _mark(Path(file.filename))
        known = size > LONG and mark in _as_written
        once: dict[int | None, str] = {}
        # one mapping for all arrays, because each mapping keeps a file open
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
                "has no checksum, so that damage to its values cannot be detected",
            )
        if newer:
            return record, "has a newer format, so that its checksum cannot be verified here"
        checksum = _as_written[mark] if known else digest.hexdigest()
        if root_text(file, CHECKSUM) != checksum:
            return record, _ALTERED
        _as_written[mark] = checksum
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
    """Return the kind of a file: `dataset`, `segmentation`, `fit`, `model` or `validation`. Raises
    DataError for anything else.
    """
    with _opened_file(path) as (_, kind, _version):
        return kind


def checksum_of(path: Path, anew: bool) -> str | None:
    """Return the checksum of a result file if its values still match it; None for a changed file
    and for any other file. With `anew`, the checksum is computed again even if this process already
    knows it.
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
    """Write a model to a file. The model can be used without any other file. `provenance` holds
    texts of any length about the origin of the model, for example the resolved spec.
    """
    MODEL_FILE.write(path, model, provenance=provenance)


def write_segmentation(path: Path, curves: tuple[SegmentedCurve, ...], *units: Units) -> None:
    """Write how the training curves are cut into segments: the boundaries and row numbers of the
    segments, but not the samples.
    """
    SEGMENTATION_FILE.write(path, SegmentationFile(tuple(curves)), *units)


def read_segmentation(
    path: Path, warn: Warn = lambda _message: None, unverified: bool = False
) -> tuple[SegmentedCurve, ...]:
    """Read from a file how the training curves are cut into segments. Raises DataError as described
    in the docstring of the module.
    """
    return SEGMENTATION_FILE.read(path, warn, unverified).curves


def _keep(mark: tuple[int, ...], record: object) -> None:
    """Keep a record in memory, and forget the oldest one if there are too many."""
    _latest[mark] = record
    while len(_latest) > REMEMBERED:
        del _latest[next(iter(_latest))]


def _mark(path: Path) -> tuple[int, ...]:
    """Return numbers by which the state of a file is recognised: they change if the file is
    replaced or written to.
    """
    state = path.stat()
    return state.st_dev, state.st_ino, state.st_mtime_ns, state.st_size


@contextmanager
def _opened_file(path: Path) -> Iterator[tuple[h5py.File, str, str]]:
    """Open a file for reading, and return it with its kind and version. Raises DataError for
    invalid contents, and for a file that mapmore did not write.
    """
    if not path.is_file():
        if path.exists():
            raise DataError(f"{path}: is a folder or a special file, not a file", _GIVE_OURS)
        raise DataError(f"{path}: no such file", "`mapmore run CONFIG` makes it")
    note_read([path])
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
                    (
                        f"{path}: has the format {version}, which dates from before the first "
                        "release"
                    ),
                    _GET_ANOTHER,
                )
            yield file, str(kind), version
    except Invalid as fault:
        remedy = f"{_GET_ANOTHER}; if it was made with a plug-in, install the plug-in"
        raise DataError(f"{path}: is not a valid {kind}: {fault}", remedy) from fault
