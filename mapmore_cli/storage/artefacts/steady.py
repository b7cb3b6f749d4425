"""A file that HDF5 can write to while the disk fills up."""

from __future__ import annotations

from io import RawIOBase


class SteadyFile:
    """A file, as HDF5 wants it, in which no write fails: the first fault is kept, and what comes after it goes nowhere.

    HDF5 cannot close a file that it could not write: it crashes at the exit of the program. So it never learns of the fault; the caller
    asks for it when the file is closed.
    """

    def __init__(self, file: RawIOBase) -> None:
        self._file = file
        self._fault: OSError | None = None

    def tell_fault(self) -> None:
        """Raise the OSError that a write met, if one did."""
        if self._fault is not None:
            raise self._fault

    def write(self, data: memoryview) -> int:
        """Write, or do as if."""
        rest = memoryview(data)
        while len(rest) and self._fault is None:
            try:
                rest = rest[self._file.write(rest) :]
            except OSError as fault:
                self._fault = fault
        return len(data)

    def truncate(self, size: int) -> int:
        """Set the length, or do as if."""
        if self._fault is None:
            try:
                self._file.truncate(size)
            except OSError as fault:
                self._fault = fault
        return size

    def read(self, size: int) -> bytes | None:
        """Read at the current place; h5py takes an object without it for a path."""
        return self._file.read(size)

    def readinto(self, buffer: memoryview) -> int | None:
        """Read at the current place into a buffer."""
        return self._file.readinto(buffer)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """The current place."""
        return self._file.tell()

    def flush(self) -> None:
        """Nothing is held back."""
