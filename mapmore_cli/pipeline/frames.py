"""Convert arrays and tables of other libraries to numbers: NumPy, pandas, polars, pyarrow, xarray,
pint, lists and plain numbers.

None of these libraries is imported; their objects are recognised by their attributes.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, MapmoreError

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
ABSENT = ("NoneType", "NAType", "NaTType", "MaskedConstant")
"""Names of types that mean a missing value: None, `pd.NA`, `pd.NaT`, `np.ma.masked`."""


@dataclass(frozen=True)
class Door:
    """Converter from values that users pass to arrays of numbers.

    - `convert`: function that converts numbers from a unit, given as text, to the wanted unit.
    - `cell`: function that converts a text, a date or a duration to a number, as for a cell of a
      file. If it is None, such values are refused.
    - `clock`: True if dates and durations are accepted. They are converted to seconds (dates since
      1970) before `convert` is called.
    """

    convert: Callable[[Array, str], Array]
    cell: Callable[[Any], float] | None = None
    clock: bool = False

    def numbers(self, values: object, label: str, axis: str = "row") -> Array:
        """Return values as numbers, in an array of the same shape. Missing values (masked, None,
        NA, NaT) become NaN. `label` is the name of the values in error messages.

        Raises DataError for values that are not numbers (texts, truth values, complex numbers, and
        dates unless `clock` is True), and for units that cannot be converted.
        """
        try:
            return np.asarray(self._read(values, label, axis), dtype=np.float64)
        except (MapmoreError, TypeError, ValueError) as fault:
            reason = str(getattr(fault, "message", fault))
            message = reason if reason.startswith(label) else f"{label}: {reason}"
            raise DataError(
                message, getattr(fault, "remedy", "use numbers, and None for a missing value")
            ) from fault

    def _read(self, values: object, label: str, axis: str) -> Any:
        if type(values).__name__ in ABSENT:
            return np.nan
        if isinstance(values, list | tuple):
            # fast path for arrays of plain numbers, the most common case
            number_types = (int, float)
            numbered = enumerate(values)
            return [
                value
                if type(value) in number_types
                else self.numbers(value, f"{label}, {axis} {i}", "column")
                for i, value in numbered
            ]
        if self.clock and isinstance(values, datetime):
            values = (values if values.tzinfo else values.replace(tzinfo=UTC)) - EPOCH
        if self.clock and isinstance(values, timedelta):
            return self._seconds(values.total_seconds())
        if isinstance(values, str | date | time | timedelta) and self.cell is not None:
            return self.cell(values)
        return self._array(values, label, axis)

    def _array(self, values: Any, label: str, axis: str) -> object:
        if hasattr(values, "dims") and "units" not in values.attrs:
            values = values.data  # an xarray object wraps an array of NumPy or pint
        unit, bare = in_unit(values)
        if unit is not None:
            return self.convert(self.numbers(bare, label, axis), unit)
        array, masked = np.asarray(values), np.ma.isMA(values) and np.ma.getmaskarray(values)
        kind = array.dtype.kind
        if kind in "OUT" and array.ndim:
            return self._read(
                np.where(masked, np.array(None), array.astype(object)).tolist(), label, axis
            )
        if kind == "O":
            return float(values)
        if kind in "mM":
            array = self._seconds(
                (array - np.datetime64(0, "s") if kind == "M" else array) / np.timedelta64(1, "s")
            )
        elif kind not in "iuf":
            words = {"b": "true and false are not numbers", "c": "Complex data not supported"}
            raise ValueError(words.get(kind, f"'{values!s:.40}' is not a number"))
        return np.where(masked, np.nan, array) if np.any(masked) else array

    def _seconds(self, seconds: Any) -> Array:
        if not self.clock:
            raise ValueError("it contains dates and times, which only `time` may contain")
        return self.convert(np.asarray(seconds, dtype=np.float64), "s")


def in_unit(values: object) -> tuple[str | None, Any]:
    """Return the unit of an array (None for an array without unit) and its numbers. Units of pint,
    astropy and unyt are recognised, and the unit in the `attrs` of xarray.
    """
    for unit, bare in (("units", "magnitude"), ("unit", "value"), ("units", "value")):
        if hasattr(type(values), unit) and hasattr(type(values), bare):
            return str(getattr(values, unit)).replace(" ** ", "**"), getattr(values, bare)
    unit_of_attrs = getattr(values, "attrs", {}).get("units")
    return (None, values) if unit_of_attrs is None else (str(unit_of_attrs), np.asarray(values))


def labels_of(table: object) -> tuple[Hashable, ...] | None:
    """Return the labels of the columns of a table, unchanged; None if the object is no such table.

    Tables are mappings of arrays, structured arrays, data frames with `columns`, pyarrow tables
    with `column_names`, and datasets of xarray. Raises DataError for a lazy table whose values are
    not computed yet, and for hierarchical labels.
    """
    if hasattr(type(table), "collect"):
        raise DataError(
            "the frame is lazy: it contains no values yet",
            "call .collect(), and pass the result",
        )
    names: Any = getattr(getattr(table, "dtype", None), "names", None)
    if isinstance(table, Mapping):
        names = getattr(table, "variables", table)
    else:
        names = getattr(
            table, "column_names" if hasattr(type(table), "column_names") else "columns", names
        )
    if getattr(names, "nlevels", 1) > 1:
        remedy = 'join the levels: `df.columns = ["_".join(map(str, one)) for one in df.columns]`'
        raise DataError(
            "the columns of the frame have labels of several levels (a MultiIndex)", remedy
        )
    return None if names is None else tuple(names)
