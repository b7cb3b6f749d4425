"""Attributes and short arrays put into a file through h5py's low-level interface.

The bytes are those of `attrs[name] = value` and `create_dataset(name, data=value, track_times=False)`, which take several times as long:
the files of a run are made of hundreds of small values.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import h5py


def put_attribute(place: h5py.h5i.ObjectID, name: str, value: Any, dtype: str | None) -> None:
    """Give a new attribute to a group or dataset: numbers of a `dtype`, or texts (None)."""
    from h5py import h5a, h5s

    kind, in_file, in_memory = _types(dtype)
    data = np.asarray(value, kind)
    h5a.create(place, name.encode(), in_file, h5s.create_simple(data.shape)).write(data, mtype=in_memory)


def put_array(group: h5py.h5g.GroupID, name: str, values: Any, dtype: str | None) -> h5py.h5d.DatasetID:
    """A new contiguous dataset: numbers of a `dtype`, or texts (None)."""
    from h5py import h5d, h5s

    kind, in_file, in_memory = _types(dtype)
    data = np.asarray(values, kind, order="C")
    dataset = h5d.create(group, name.encode(), in_file, h5s.create_simple(data.shape), _without_times())
    dataset.write(h5s.ALL, h5s.ALL, data, in_memory)
    return dataset


@cache
def _types(dtype: str | None) -> tuple[np.dtype[Any], Any, Any]:
    """How NumPy, the file and the memory hold values."""
    from h5py import h5t, string_dtype

    kind = string_dtype() if dtype is None else np.dtype(dtype)
    return kind, h5t.py_create(kind, logical=True), h5t.py_create(kind)


@cache
def _without_times() -> Any:
    from h5py import h5p

    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_obj_track_times(False)
    return properties
