"""Files read as a spec asks for them, under the name `a.SUFFIX`; and refusals with all that they
have to say.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.io

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import READERS, TableRequest

SUFFIXES = {"hdf5": "h5"}


def tables_of(reader, path, *columns, **request):
    """The recordings of a file."""
    return READERS[reader].read(
        path, TableRequest(f"a.{SUFFIXES.get(reader, reader)}", columns, **request)
    )


def table_of(reader, path, *columns, **request):
    """The one recording of a file."""
    (table,) = tables_of(reader, path, *columns, **request)
    return table


def csv_table(path, content, *columns, **request):
    """What is read of some text."""
    path.write_bytes(content)
    return table_of("csv", path, *columns, **request)


def refusal(parts, reader, path, *columns, **request):
    """The message of the error with which a file is refused, which has all of the `parts`."""
    with pytest.raises(DataError) as caught:
        tables_of(reader, path, *columns, **request)
    message = str(caught.value)
    assert all(part in message for part in parts), message
    return message


def opaque_mat(path, name, of_class, x):
    """A file of version 7 with an object as MATLAB lays it out, and the numbers `x`: only what a
    reader sees before the contents.
    """

    def element(kind, content):
        return (
            np.array([kind, len(content)], "<u4").tobytes() + content + b"\0" * (-len(content) % 8)
        )

    numbers = element(6, np.array([13, 0], "<u4").tobytes()) + element(
        5, np.array([1, 1], "<i4").tobytes()
    )
    numbers = element(
        14, numbers + element(1, b"") + element(6, np.array([0xDD000000], "<u4").tobytes())
    )
    words = b"".join(element(1, word.encode()) for word in (name, "MCOS", of_class))
    scipy.io.savemat(path, {"x": x})
    with path.open("ab") as file:
        file.write(element(14, element(6, np.array([17, 0], "<u4").tobytes()) + words + numbers))
    return path
