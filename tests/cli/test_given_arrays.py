"""One door for arrays and tables that others made: the same values give the same numbers, and
nothing is dropped silently.
"""

import warnings
from datetime import UTC, datetime, timedelta, timezone
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mapmore_cli as mm
from mapmore_cli.domain.errors import DataError
from mapmore_cli.pipeline.tables_in_memory import canonical_columns, given_numbers, tables_of

UNITS = pint.UnitRegistry()
NA = type("NAType", (), {})()  # as pandas has it: no number, and no truth value
P, E = np.repeat([100.0, 200.0, 300.0], 9), np.tile(np.linspace(0, 0.2, 9), 3)
F = 3.3 * P * (1 - 3.2 * E) ** 2 - 70
TABLE = {"pressure": P, "strain": E, "force": F}
SECTIONS = {
    "levels": {"of": "pressure", "at": "auto"},
    "dictionary": [{"polynomial": {"of": ["strain"], "order": 2}}],
    "fit": {"max_terms": 3},
    "validate": {"simple": False},
}
BY_NUMBER = {
    "pressure": {"column": 0, "unit": "kPa"},
    "strain": {"column": 1},
    "force": {"column": 2, "unit": "N"},
}


class Frame:
    """What pandas and polars frames have in common; labels may be anything."""

    def __init__(self, columns, labels=None):
        self._columns, self.columns = columns, list(columns) if labels is None else labels

    def __getitem__(self, label):
        return self._columns[label]


class Table:
    """As pyarrow has it: `columns` are the arrays themselves."""

    def __init__(self, columns):
        self._columns = columns

    column_names = property(lambda self: list(self._columns))
    columns = property(lambda self: list(self._columns.values()))

    def __getitem__(self, name):
        return self._columns[name]


class Labelled:
    """As xarray has it: an array with dimensions and attributes."""

    def __init__(self, data, **attrs):
        self.data, self.attrs, self.dims = data, attrs, ("i",)

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.data, dtype)


class Resolved:
    """As a DatetimeIndex of pandas has it: a `unit` that is the resolution of the clock."""

    def __init__(self, stamps):
        self.stamps, self.dtype = stamps, stamps.dtype

    unit = property(lambda self: np.datetime_data(self.stamps.dtype)[0])

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.stamps, dtype)


def read(values, name="pressure", unit="kPa"):
    return given_numbers(values, "it", name, unit)


KINDS = {
    "list": list,
    "tuple": tuple,
    "objects": lambda v: np.array(v, dtype=object),
    "texts": lambda v: [repr(one) for one in v],
    "text array": lambda v: np.array([repr(one) for one in v]),
    "decimals": lambda v: [Decimal(repr(one)) for one in v],
    "fractions": lambda v: [Fraction(one) for one in v],
    "numpy scalars": lambda v: [np.float64(one) for one in v],
    "big-endian": lambda v: np.array(v, dtype=">f8"),
    "long double": lambda v: np.array(v, dtype=np.longdouble),
    "strided": lambda v: np.repeat(v, 3)[::3],
    "backwards": lambda v: np.array(v[::-1])[::-1],
    "column of a table": lambda v: np.column_stack([v, v])[:, 1],
    "read-only": lambda v: np.frombuffer(np.array(v).tobytes()),
    "unmasked": np.ma.array,
    "masks nothing": lambda v: np.ma.array(v, mask=False),
    "in the unit": lambda v: np.array(v) * UNITS.kPa,
    "list in the unit": lambda v: [one * UNITS.kPa for one in v],
    "labelled": lambda v: Labelled(np.array(v)),
    "labelled with its unit": lambda v: Labelled(np.array(v), units="kPa"),
    "labelled around pint": lambda v: Labelled(np.array(v) * UNITS.kPa),
}


@pytest.mark.parametrize("kind", KINDS)
@given(
    values=st.lists(
        st.floats(-1e6, 1e6).filter(lambda one: one == 0 or abs(one) > 1e-6), min_size=1, max_size=6
    )
)
def test_the_same_values_are_the_same_numbers(kind, values):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = read(KINDS[kind](values))
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, values)


@pytest.mark.parametrize("dtype", ["i1", "u1", "u2", "i4", "u8", "f2", ">f4", "<i2"])
def test_every_type_of_numbers_will_do(dtype):
    np.testing.assert_array_equal(read(np.array([0, 1, 7, 100], dtype=dtype)), [0, 1, 7, 100])


MASKED = np.ma.array([1.0, 1e20, 3.0], mask=[0, 1, 0])


@pytest.mark.parametrize(
    "values",
    [
        *(
            [1.0, None, 3.0],
            [1.0, NA, 3.0],
            [1, np.nan, 3],
            [1.0, np.ma.masked, 3.0],
            ["1", None, 3],
            ["1", "", "3"],
        ),
        *(
            np.array([1, NA, 3], dtype=object),
            MASKED,
            np.ma.array([1, 99, 3], mask=[0, 1, 0]),
            MASKED.astype(object),
            MASKED * UNITS.kPa,
        ),
        np.ma.array([1, "what is masked is not read", 3], mask=[0, 1, 0], dtype=object),
        [MASKED[:1], MASKED[1:2], MASKED[2:]],
    ],
)
def test_what_is_masked_or_absent_is_missing(values):
    np.testing.assert_array_equal(read(values).ravel(), [1, np.nan, 3])


@pytest.mark.parametrize(
    ("values", "unit", "expected"),
    [
        (2 * UNITS.bar, "kPa", 200.0),
        ([2 * UNITS.bar, 300 * UNITS.kPa], "kPa", [200.0, 300.0]),
        (np.array([20.0]) * UNITS.percent, "1", [0.2]),
        (0.2 * UNITS.dimensionless, "%", 20.0),
        (UNITS.Quantity(20.0, "degC"), "K", 293.15),
        (UNITS.Quantity(1.0, "m/s**2"), "mm/s^2", 1000.0),
        (Labelled(np.array([2.0]), units="bar"), "Pa", [2e5]),
    ],
)
def test_units_are_converted(values, unit, expected):
    np.testing.assert_allclose(read(values, "p", unit), expected, rtol=1e-14)


BERLIN = timezone(timedelta(hours=1))


@pytest.mark.parametrize(
    ("values", "seconds"),
    [
        (np.array(["1970-01-01T00:00:02", "NaT"], dtype="M8[ms]"), [2, np.nan]),
        (np.array([1500, 2000], dtype="m8[ms]"), [1.5, 2]),
        (Resolved(np.array([1_500_000_000], dtype="M8[ns]")), [1.5]),
        (
            [
                datetime(1970, 1, 1, 1, 0, 2, tzinfo=BERLIN),
                datetime(1970, 1, 1, 0, 0, 3, tzinfo=UTC),
            ],
            [2, 3],
        ),
        (np.array([datetime(1970, 1, 1, 0, 0, 2)], dtype=object), [2]),
        ([timedelta(milliseconds=1500), None], [1.5, np.nan]),
        (np.array([1500.0]) * UNITS.ms, [1.5]),
    ],
)
def test_clocks_are_seconds_and_nothing_else(values, seconds):
    np.testing.assert_array_equal(read(values, "time", "s"), seconds)
    np.testing.assert_allclose(read(values, "time", "ms"), 1000 * np.array(seconds))
    with pytest.raises(
        DataError, match=r"`time` may contain|column `time` only|cannot be converted"
    ):
        read(values)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (True, "true and false"),
        (P > 100, "true and false"),
        ([1.0, True], "row 1: true and false"),
        (np.array([1, False], dtype=object), "row 1: true and false"),
        (P + 0j, "Complex data"),
        ([1.0, "two"], "row 1: 'two' is not a number"),
        (np.array(["1", "2 kPa"]), "row 1: '2 kPa' is not a number"),
        (["1_0"], "row 0: '1_0' is not a number"),
        ([[1.0, 2.0], [3.0, "x"]], "row 1, column 1: 'x' is not a number"),
        (np.array([b"1"]), "is not a number"),
        ([[1.0, 2.0], [3.0]], "inhomogeneous"),
        ({"a": 1}, "not 'dict'"),
        ((one for one in P), "not 'generator'"),
        (np.zeros(2, dtype="f8,f8"), "is not a number"),
        (2 * UNITS.mm, "unit 'millimeter' .* cannot be converted to 'kPa'"),
        ([2 * UNITS.kPa, 2 * UNITS.mm], "row 1: unit 'millimeter'"),
        (Labelled(P, units="furlong per fortnight"), "unit 'furlong per fortnight'"),
    ],
)
def test_all_else_is_refused_with_its_place(values, told):
    with pytest.raises(DataError, match=told) as raised:
        read(values)
    assert str(raised.value).startswith("it")


# --- tables
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "columns"),
    [
        (Frame({2: F, 0: P, 1: E}), BY_NUMBER),  # a label comes before a place
        (Table(TABLE), None),
        (np.ma.array(np.rec.fromarrays([*TABLE.values()], names=[*TABLE])), None),
        (
            Frame(
                {"pressure": P * UNITS.kPa, "strain": E * UNITS.dimensionless, "force": F * UNITS.N}
            ),
            None,
        ),
    ],
)
def test_the_same_table_has_the_same_columns(table, columns):
    columns = columns or canonical_columns(table, "static")
    (found,) = tables_of([table], columns, {}).values()
    for name, values in TABLE.items():
        np.testing.assert_array_equal(found.columns[name], values)


class Lazy:
    """A query of polars: it has no values, and is slow to tell its columns."""

    @property
    def columns(self):
        raise AssertionError("was asked")

    def collect(self):
        raise AssertionError("was computed")


class Levels(list):
    nlevels = 2


@pytest.mark.parametrize(
    ("table", "told"),
    [
        (Lazy(), r"call \.collect\(\)"),
        (Frame({}, Levels([("a", "force")])), "MultiIndex"),
        (
            Frame(TABLE, [*TABLE, "force"]),
            "'force' exists more than once",
        ),
        (
            {**TABLE, "pressure": P * UNITS.mm},
            "column 'pressure': unit 'millimeter'",
        ),
    ],
)
def test_what_is_wrong_with_a_table_is_told(table, told):
    with pytest.raises(DataError, match=told):
        mm.fit(table, **SECTIONS)


def test_every_use_of_a_model_has_the_same_door():
    fitted = mm.fit(TABLE, **SECTIONS)
    bar, ten = 2 * UNITS.bar, 10 * UNITS.percent
    plain = {"pressure": 200.0, "strain": 0.1}
    assert fitted(pressure=bar, strain=ten) == fitted(**plain)
    assert fitted.predict({"pressure": [2.0] * UNITS.bar, "strain": [0.1]}) == fitted(**plain)
    assert fitted.derivatives(pressure=bar, strain=ten) == fitted.derivatives(**plain)
    assert not fitted.outside_range(pressure=bar, strain=ten)
    wanted = fitted.invert("pressure", force=0.1 * UNITS.kN, strain=ten)
    np.testing.assert_allclose(
        wanted.picked, fitted.invert("pressure", force=100, strain=0.1).picked
    )
    np.testing.assert_array_equal(
        np.isnan(fitted(pressure=np.ma.array([200, 1e9], mask=[0, 1]), strain=0.1)), [False, True]
    )
    with pytest.raises(DataError, match="`pressure`: unit 'millimeter'"):
        fitted(pressure=2 * UNITS.mm, strain=0.1)
    with pytest.raises(DataError, match="`strain`: true and false"):
        fitted.invert("pressure", force=100, strain=True)


def test_a_table_in_memory_cannot_change_the_arrays_of_its_owner():
    given = np.arange(3.0)
    columns = tables_of([{"pressure": given}], {"pressure": "pressure"}, {})["recording_1"].columns
    assert np.shares_memory(columns["pressure"], given)
    with pytest.raises(ValueError, match="read-only"):
        columns["pressure"][0] = 1
    given[0] = 5  # its owner can
