"""The result files of a run: one pair of functions for each kind of HDF5 file, and the score table.

Every `write_*` makes a whole file or none (WriteError), with bytes that depend on the arguments only. Every `read_*` raises DataError,
naming the file, for one that is missing, damaged, of another kind or of a newer format, that holds what the format does not know or values
of another type or shape, or whose values are not those that were written; `unverified` accepts the last, and `warn` is told of it, and of
files without a checksum.

`units` of `write_segmentation` and `write_fit` are those of `units_of(dataset)`: the types written there do not know them.

A file from a stranger is looked over before any value is read: HDF5 can point into other files of the computer, at one object a million
times, or at gigabytes that take a kilobyte on the disk. The files of a run are plain trees of small arrays, so whatever else is in a file
is refused by name.

Format versions are read like semantic versions: a new major is refused by older programs, a new minor only adds fields.

2.0  first released version: fits and models have a body of one kind; sums have signs and renamed inputs.
2.1  models with left-out residuals, from which intervals are made.
"""

from __future__ import annotations

import math
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Any, Generic, TypeVar

import h5py
from h5py import h5d, h5g, h5l, h5o, h5t, h5z

from mapmore_cli.domain.errors import DataError, Doubt
from mapmore_cli.domain.fits import SegmentedCurve
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult, Validation
from mapmore_cli.storage.artefacts.codecs import NO_UNIT, Digest, Invalid, Label, Writer, stored_at, texts_at_once, texts_left
from mapmore_cli.storage.artefacts.schema import SegmentationFile, check_lengths, schema_of
from mapmore_cli.storage.atomic import replacing
from mapmore_cli.storage.run_record import refuse_newer

FORMAT_VERSION = "2.1"

CHECKSUM = "checksum"
"""Attribute of the root: SHA-256 (hexadecimal) of all values in the file."""

DEEPEST, MOST_ATTRIBUTES = 60, 100
"""Groups within groups (ten sums of sums), and attributes of one object."""

ROOM, RATIO = 64_000_000, 300
"""Bytes that a file of any size may unpack to, and that one chunk may have; and beyond that, how many times its own size: columns that
stand still shrink a thousandfold, whole recordings tenfold."""

_ALTERED = "its values are not those that were written: the checksum does not match"
_GET_ANOTHER = "get a fresh copy, or make it again with `mapmore run CONFIG`"
_GIVE_OURS = "give a file out of a run folder, as runs/NAME/model.h5"

Warn = Callable[[str], None]
T = TypeVar("T")
NO_UNITS: Mapping[str, str] = {}


@dataclass(frozen=True)
class FileKind(Generic[T]):
    """A kind of file: its name in the attribute `kind`, the stage that makes it, and the type of what its root holds."""

    name: str
    stage: str
    type: type[T]

    def write(self, path: Path, record: T, units: Mapping[str, str] = NO_UNITS, provenance: Mapping[str, str] | None = None) -> None:
        """Write `record`; `units` are those that it does not know itself. The bytes depend on the arguments only.

        Raises WriteError where the disk is full.
        """
        with replacing(path) as place, _interrupted_later():
            steady = SteadyFile(place.fileno(), "r+b", closefd=False)
            try:
                # Settled versions and no times: two writes give the same bytes, and old readers understand them.
                with h5py.File(steady, "w", driver="fileobj", libver=("earliest", "v110")) as file:
                    file.attrs["kind"] = self.name
                    file.attrs["format_version"] = FORMAT_VERSION
                    file.attrs["creator"] = "mapmore"
                    schema_of(self.type).store(Writer(file), record, Label(scope=units))
                    file.attrs[CHECKSUM] = self._checksum(record)
                    if provenance is not None:
                        _write_provenance(file, provenance)
            finally:
                if steady.fault is not None:
                    raise steady.fault

    def read(self, path: Path, warn: Warn = lambda _message: None, unverified: bool = False) -> T:
        """Return the record in a file; `warn` is told where nothing says that it is as it was written.

        Raises DataError as the module says, for a checksum that does not match only where it may not be `unverified`.
        """
        with _opened(path) as file:
            found, version = _kind_and_version(path, file)
            if found != self.name:
                raise DataError(f"{path}: is a {found} file, not a {self.name} file", f"give a file that `mapmore {self.stage}` wrote")
            try:
                _look_over(file, path.stat().st_size)
                record: T = schema_of(self.type).read(file)
                check_lengths(record)
                doubt = self._doubt(file, version, record)
            except Invalid as fault:
                raise DataError(f"{path}: is not a valid {self.name}: {fault}", _GET_ANOTHER) from fault
        if doubt == _ALTERED and not unverified:
            raise DataError(f"{path}: {_ALTERED}", f"{_GET_ANOTHER}; `--unverified` reads it all the same")
        if doubt:
            warn(Doubt.of(str(path), doubt))
        return record

    def _doubt(self, file: h5py.File, version: str, record: T) -> str | None:
        """Why the values may not be those that were written; None where the checksum says that they are."""
        with stored_at(CHECKSUM):
            stored = file.attrs.get(CHECKSUM)
        if stored is None:
            return "has no checksum: nothing shows whether its values are those that were written"
        if _as_numbers(version) > _as_numbers(FORMAT_VERSION):
            return f"is of the newer format {version}: its checksum cannot be verified here"
        return None if isinstance(stored, str) and stored == self._checksum(record) else _ALTERED

    def _checksum(self, record: T) -> str:
        digest = Digest()
        schema_of(self.type).store(digest, record, Label())
        return str(digest.hash.hexdigest())


DATASET_FILE = FileKind("dataset", "ingest", Dataset)
SEGMENTATION_FILE = FileKind("segmentation", "segment", SegmentationFile)
FIT_FILE = FileKind("fit", "fit", FitResult)
MODEL_FILE = FileKind("model", "fuse", Model)
VALIDATION_FILE = FileKind("validation", "validate", Validation)
KINDS: tuple[FileKind[Any], ...] = (DATASET_FILE, SEGMENTATION_FILE, FIT_FILE, MODEL_FILE, VALIDATION_FILE)


def kind_of(path: Path) -> str:
    """`dataset`, `segmentation`, `fit`, `model` or `validation`; DataError for anything else."""
    with _opened(path) as file:
        return _kind_and_version(path, file)[0]


def units_of(dataset: Dataset) -> dict[str, str]:
    """Return the units by quantity, with those of the `target` and the `level`, for the files of the later stages."""
    units = {name: quantity.unit for name, quantity in dataset.quantities.items()}
    level = {"level": dataset.unit(dataset.level)} if dataset.level else {}
    return {**units, "target": dataset.unit(dataset.target), **level}


write_dataset, read_dataset = DATASET_FILE.write, DATASET_FILE.read
write_fit, read_fit = FIT_FILE.write, FIT_FILE.read
write_validation, read_validation = VALIDATION_FILE.write, VALIDATION_FILE.read
read_model = MODEL_FILE.read


def write_model(path: Path, model: Model, provenance: Mapping[str, str] = NO_UNITS) -> None:
    """Write a model that stands alone; `provenance` may hold texts of any length, as the resolved spec."""
    MODEL_FILE.write(path, model, provenance=provenance)


def write_segmentation(path: Path, curves: tuple[SegmentedCurve, ...], units: Mapping[str, str] = NO_UNITS) -> None:
    """Write where the training curves are cut: boundaries and row numbers, no samples."""
    SEGMENTATION_FILE.write(path, SegmentationFile(tuple(curves)), units)


def read_segmentation(path: Path, warn: Warn = lambda _message: None, unverified: bool = False) -> tuple[SegmentedCurve, ...]:
    """Read where the training curves are cut."""
    return SEGMENTATION_FILE.read(path, warn, unverified).curves


def _write_provenance(file: h5py.File, provenance: Mapping[str, str]) -> None:
    """One string dataset for every entry: attributes could not hold more than 64 kB."""
    group = file.create_group("provenance")
    for name, text in provenance.items():
        dataset = group.create_dataset(name, data=text.replace("\0", ""), dtype=h5py.string_dtype(), track_times=False)
        Label("where the file comes from", NO_UNIT).put_on(dataset)


def _kind_and_version(path: Path, file: h5py.File) -> tuple[str, str]:
    try:
        with stored_at(""):
            kind, version = file.attrs.get("kind"), file.attrs.get("format_version")
    except Invalid as fault:
        raise DataError(f"{path}: {fault}", _GET_ANOTHER) from fault
    if not isinstance(kind, str) or kind not in {known.name for known in KINDS} or not isinstance(version, str):
        raise DataError(f"{path}: is an HDF5 file, but not one of mapmore's", _GIVE_OURS)
    refuse_newer(path, version, FORMAT_VERSION)
    if _as_numbers(version) < (2,):
        raise DataError(f"{path}: is of the format {version}, from before the first release", _GET_ANOTHER)
    return kind, version


def _as_numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) if part.isdigit() else 0 for part in version.split("."))


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """Open the file for reading; DataError where HDF5 cannot open it. What goes wrong in the block is not this one's to explain."""
    if not path.exists():
        raise DataError(f"{path}: no such file", "`mapmore run CONFIG` makes it")
    if not path.is_file():
        raise DataError(f"{path}: is a folder or a special file, not a file", _GIVE_OURS)
    try:
        file = h5py.File(path, "r")
    except OSError as fault:
        why = str(fault).splitlines()[0] if str(fault) else type(fault).__name__
        raise DataError(f"{path}: cannot be read ({why})", f"give a file that mapmore wrote; {_GET_ANOTHER}") from fault
    with file:
        yield file


def _look_over(file: h5py.File, size: int) -> None:
    """Raise Invalid for a file that is no plain tree of numbers and texts, or that unpacks to far more than its `size` in bytes.

    No value is read. Refused are links of all kinds but one hard link to every object, data in other files (external storage, virtual
    datasets), filters other than gzip and byte shuffle, types other than numbers and texts, and groups too deep.
    """
    most = room = ROOM + RATIO * size
    texts_left.set(most)
    texts_at_once.set(max(1, ROOM // max(size, 1)))
    with stored_at(""):
        seen = {h5o.get_info(file.id).addr}
    open_groups: list[tuple[str, Any, int]] = [("", h5g.open(file.id, b"/"), 0)]
    while open_groups:
        path, group, depth = open_groups.pop()
        links: list[tuple[bytes, int]] = []
        with stored_at(path):
            group.links.iterate(lambda name, info, links=links: links.append((name, info.type)), info=True)
        for name, kind in links:
            where = f"{path}/{name.decode(errors='replace')}"
            if kind != h5l.TYPE_HARD:
                raise Invalid(where, "is a link to somewhere else")
            with stored_at(where):
                info = h5o.get_info(group, name)
            if info.addr in seen:
                raise Invalid(where, "is linked more than once")
            seen.add(info.addr)
            if info.num_attrs > MOST_ATTRIBUTES:
                raise Invalid(where, f"has {info.num_attrs} attributes")
            if info.type not in (h5o.TYPE_GROUP, h5o.TYPE_DATASET):
                raise Invalid(where, "is neither a group nor a dataset")
            if info.type == h5o.TYPE_GROUP and depth == DEEPEST:
                raise Invalid(where, f"lies more than {DEEPEST} groups deep")
            with stored_at(where):
                if info.type == h5o.TYPE_GROUP:
                    open_groups.append((where, h5g.open(group, name), depth + 1))
                else:
                    room -= _bytes_of(h5d.open(group, name), where)
            if room < 0:
                raise Invalid(where, f"brings the file of {size} bytes to more than {most / 1e6:.0f} MB of values")


def _bytes_of(dataset: Any, where: str) -> int:
    """Bytes of the values of a dataset; Invalid where they do not lie plainly in this file."""
    plist, kind = dataset.get_create_plist(), dataset.get_type()
    layout, width = plist.get_layout(), int(kind.get_size())
    if layout not in (h5d.COMPACT, h5d.CONTIGUOUS, h5d.CHUNKED) or plist.get_external_count():
        raise Invalid(where, "takes its values from other files or datasets")
    if {plist.get_filter(place)[0] for place in range(plist.get_nfilters())} - {h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE}:
        raise Invalid(where, "is packed by a filter other than gzip and byte shuffle")
    if kind.get_class() not in (h5t.FLOAT, h5t.INTEGER, h5t.STRING):
        raise Invalid(where, "holds neither numbers nor texts")
    if layout == h5d.CHUNKED and math.prod(plist.get_chunk()) * width > ROOM:
        raise Invalid(where, f"is cut into chunks of more than {ROOM // 10**6} MB")
    return int(math.prod(dataset.shape)) * width


@contextmanager
def _interrupted_later() -> Iterator[None]:
    """Let Ctrl-C wait: what is raised while HDF5 calls back is lost, and the program goes on as if nobody had asked it to end."""
    ours = threading.current_thread() is threading.main_thread() and callable(signal.getsignal(signal.SIGINT))
    heard: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: heard.append(number)) if ours else None
    try:
        yield
    finally:
        if before is not None:
            signal.signal(signal.SIGINT, before)
    for number in heard[:1]:
        signal.raise_signal(number)


class SteadyFile(FileIO):
    """A file, as HDF5 wants it, in which no write fails: the first `fault` is kept, and what comes after it goes nowhere.

    HDF5 cannot close a file that it could not write: it crashes at the exit of the program. So it never learns of the fault; the caller
    looks for it when the file is closed.
    """

    fault: OSError | None = None

    def write(self, data: Any) -> int:
        """Write, or do as if."""
        rest = memoryview(data)
        while len(rest) and self.fault is None:
            try:
                rest = rest[super().write(rest) :]
            except OSError as fault:
                self.fault = fault
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        """Set the length, or do as if."""
        try:
            return super().truncate(size) if self.fault is None else size or 0
        except OSError as fault:
            self.fault = fault
            return size or 0
