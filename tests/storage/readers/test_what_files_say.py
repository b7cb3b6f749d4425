"""What HDF5, netCDF and TDMS files say of their numbers, and what workbooks hide."""

import h5py
import numpy as np
import pytest
from common import peak_memory
from reading import refusal, table_of, tables_of, workbook

NAN = np.nan
SHORTS, BYTES = np.array([0, 50, 200], "i2"), np.array([-1, 1, -2], "i1")
REALS = np.array([-5.0, 0, 5])
STORED = {
    "scaled": (
        np.array([0, 10, -20], "i2"),
        {"scale_factor": 0.1, "add_offset": np.array([5.0])},
        [5, 6, 3],
    ),
    "big-endian, fill value": (
        np.array([0, -32768, 7], ">i2"),
        {"_FillValue": np.array([-32768], ">i2")},
        [0, NAN, 7],
    ),
    "fill value, scaled": (
        np.array([0, -1, 7], "i4"),
        {"_FillValue": np.int32(-1), "scale_factor": np.float32(2)},
        [0, NAN, 14],
    ),
    "several missing": (
        np.array([-999.0, 1, -888]),
        {"missing_value": np.array([-999, -888], "i4")},
        [NAN, 1, NAN],
    ),
    "float32 by a double": (np.array([1e20, 1, 2], "f4"), {"missing_value": 1e20}, [NAN, 1, 2]),
    "a mark too large for float32": (np.array([1, 2, 3], "f4"), {"_FillValue": 1e300}, [1, 2, 3]),
    "fill value is NaN": (np.array([NAN, 1, 2]), {"_FillValue": NAN}, [NAN, 1, 2]),
    "valid range as stored": (
        SHORTS,
        {"valid_range": np.array([1, 100], "i2"), "scale_factor": 0.1},
        [NAN, 5, NAN],
    ),
    "valid range as meant": (
        SHORTS,
        {"valid_range": [1.0, 10.0], "scale_factor": 0.1},
        [NAN, 5, NAN],
    ),
    "valid range, one end as meant": (
        SHORTS,
        {"valid_min": np.int16(1), "valid_max": 10.0, "scale_factor": 0.1},
        [NAN, 5, NAN],
    ),
    "valid_min as stored": (
        SHORTS,
        {"valid_min": np.int16(40), "scale_factor": 0.1},
        [NAN, 5, 20],
    ),
    "valid_min": (REALS, {"valid_min": 0.0}, [NAN, 0, 5]),
    "valid_max": (REALS, {"valid_max": 0.0}, [-5, 0, NAN]),
    "unsigned": (
        BYTES,
        {"_Unsigned": "true", "_FillValue": np.int8(-1)},
        [NAN, 1, 254],
    ),
    "not unsigned": (BYTES, {"_Unsigned": "false"}, [-1, 1, -2]),
    "nothing": (BYTES, {"comment": "x" * 9000}, [-1, 1, -2]),
}


def hdf5(path, values, said):
    with h5py.File(path, "w") as file:
        file["F"] = values
        file["F"].attrs.update(said)
    return path


@pytest.mark.parametrize(("stored", "said", "meant"), STORED.values(), ids=STORED)
def test_stored_numbers_mean_what_the_attributes_of_netcdf_say(tmp_path, stored, said, meant):
    table = table_of("hdf5", hdf5(tmp_path / "a.nc", stored, said), "F")
    np.testing.assert_allclose(table.columns["F"], meant)
    assert table.noted["F"].is_scaled == ("scale_factor" in said)


def test_a_factor_that_is_a_text_is_refused(tmp_path):
    refusal(
        ["a.h5: /F: its attribute scale_factor is not a number"],
        "hdf5",
        hdf5(tmp_path / "a.h5", [1, 2], {"scale_factor": "0.1"}),
        "F",
    )


@pytest.mark.parametrize(
    ("said", "unit"),
    [
        ({"units": "kPa"}, "kPa"),
        ({"units": np.bytes_(b"bar")}, "bar"),
        ({"Unit": np.array(["mm"], dtype=h5py.string_dtype())}, "mm"),
        (
            {"units": "x" * 5000},
            "x" * 5000,
        ),  # one text that lies elsewhere in the file, of its size at most
        ({"units": np.bytes_(b"x" * 5000)}, ""),
        ({"units": np.array(["mm"] * 5, dtype=h5py.string_dtype())}, ""),
        ({"units": np.array([b"mm", b"N"])}, ""),  # of the columns of a matrix, perhaps
    ],
)
def test_units_of_datasets(tmp_path, said, unit):
    assert table_of("hdf5", hdf5(tmp_path / "a.h5", [1.0, 2.0], said), "F").noted["F"].unit == unit


def test_netcdf_of_the_classic_format_is_named(tmp_path):
    (tmp_path / "a.nc").write_bytes(b"CDF\x01" + bytes(100))
    refusal(
        ["a.h5: is a netCDF file of the classic format", "nccopy -k nc4"],
        "hdf5",
        tmp_path / "a.nc",
        "F",
    )


def test_long_texts_and_references_are_refused(tmp_path):
    text = "x" * 5_000_000
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["F"] = np.array([text] * 20, dtype=h5py.string_dtype())
        file["R"] = np.array([file["F"].ref] * 3, dtype=h5py.ref_dtype)
        file.create_dataset("L", (2,), dtype=h5py.vlen_dtype(np.float64))[:] = [
            np.arange(3.0),
            np.arange(2.0),
        ]
        file["S"] = np.array([b"ab", b"c"])
        file["T"] = h5py.Empty("f8")
        file["type"] = np.dtype("f8")
        file["table"] = np.array(
            [("a", 0.0)] * 3, dtype=[("note", h5py.string_dtype()), ("F", "f8")]
        )

    def told_of(told, column):
        return refusal([told], "hdf5", tmp_path / "a.h5", column)

    peak = peak_memory(lambda: told_of("a.h5: 'F' holds text, not real numbers", "F"))
    assert peak < 30 * len(text)  # the file has twenty
    for column, told in {
        "R": "'R' holds references or lists, not real numbers",
        "L": "'L' holds references or lists, not real numbers",
        "S": "'S' holds text, not real numbers",
        "T": "'T' is empty",
        "type": "'type' is empty",
        "table.note": "'table.note' holds text",
    }.items():
        assert "damaged" not in told_of(told, column)
    assert list(table_of("hdf5", tmp_path / "a.h5", "table.F").columns["table.F"]) == [0, 0, 0]


def test_a_filter_that_is_not_installed_is_named(tmp_path, monkeypatch):
    sought = []
    monkeypatch.setattr("mapmore_cli.storage.readers.hdf5.import_module", sought.append)
    created = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    created.set_chunk((9,))
    created.set_filter(32001, h5py.h5z.FLAG_OPTIONAL, (2, 2))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        space = h5py.h5s.create_simple((9,))
        made = h5py.Dataset(h5py.h5d.create(file.id, b"F", h5py.h5t.NATIVE_DOUBLE, space, created))
        made.id.write_direct_chunk((0,), bytes(16), filter_mask=0)
    refusal(
        [
            "a.h5: /F is compressed by the filter 32001, which",
            "pip install hdf5plugin",
        ],
        "hdf5",
        tmp_path / "a.h5",
        "F",
    )
    assert sought == ["hdf5plugin"]


# TDMS
# --------------------------------------------------------------------------------------------------

nptdms = pytest.importorskip("nptdms")
START = np.datetime64("2026-03-01T00:00:00", "us")


def wave(step=0.01, start=START, offset=0.0, unit="kPa"):
    return {
        "wf_increment": step,
        "wf_start_time": start,
        "wf_start_offset": offset,
        "unit_string": unit,
    }


def tdms(path, p, f, length=40):
    with nptdms.TdmsWriter(str(path)) as writer:
        for name, said, n in (("P", p, 40), ("F", f, length)):
            writer.write_segment([nptdms.ChannelObject("G", name, np.arange(float(n)), said)])
    return path


@pytest.mark.parametrize("root", [None, "G", "[*]"])
@pytest.mark.parametrize(
    ("said", "told"),
    [
        (
            wave(0.009),
            [
                "P' was sampled every 0.01 s, 'G/F' every 0.009 s",
                "`sample_time: 0.009 s` and `shift: 0 s`",
            ],
        ),
        (
            wave(start=START + np.timedelta64(100, "ms")),
            ["F' begins 0.1 s after 'G/P'", "`shift: 0.1 s`"],
        ),
        (
            wave(offset=0.005),
            [
                "F' begins 0.005 s after 'G/P'",
                "`sample_time: 0.01 s` and `shift: 0.005 s`",
                "`on: row`",
            ],
        ),
        (wave(offset=-0.5), ["F' begins -0.5 s after 'G/P'", "`shift: -0.5 s`"]),
    ],
)
def test_channels_that_were_not_sampled_together_are_refused(tmp_path, said, told, root):
    columns = ("G/P", "G/F") if root is None else ("P", "F")
    told = told if root is None else [part.replace("G/", "") for part in told]
    refusal(told, "tdms", tdms(tmp_path / "a.tdms", wave(), said), *columns, root=root)


def test_channels_of_other_lengths_are_told_by_their_rates(tmp_path):
    refusal(
        ["every 0.01 s, 'G/F' every 0.1 s"],
        "tdms",
        tdms(tmp_path / "a.tdms", wave(), wave(0.1), 4),
        "G/P",
        "G/F",
    )


@pytest.mark.parametrize(
    "said",
    [
        wave(),
        wave(start=START + np.timedelta64(10, "us")),
        {},
        {"wf_increment": 0.0},
        wave(0.01 * (1 + 1e-9), unit="N"),
    ],
)
def test_channels_that_were_or_that_nobody_says_more_of_are_read(tmp_path, said):
    table = table_of("tdms", tdms(tmp_path / "a.tdms", wave(), said), "G/P", "G/F")
    assert table.size == 40
    assert (table.noted["G/P"].unit, table.noted["G/P"].step) == ("kPa", 0.01)
    assert table.noted["G/F"].unit == said.get("unit_string", "")


# Workbooks
# --------------------------------------------------------------------------------------------------

OLD, NOW, NEXT = ([["t", "F"], [0, n], [1, n]] for n in (-1, 1, 2))


def hidden(path, *titles, **sheets):
    made = workbook(path, **sheets)
    for title in titles:
        made[title].sheet_state = "hidden" if title == "old" else "veryHidden"
    made.active = next(
        (i for i, sheet in enumerate(made.worksheets) if sheet.title not in titles), 0
    )
    made.save(path)
    return path


def test_hidden_sheets_are_passed_over_but_where_they_are_named(tmp_path):
    path = hidden(tmp_path / "a.xlsx", "old", "older", old=OLD, older=OLD, now=NOW)
    assert [list(table.columns["F"]) for table in tables_of("xlsx", path, "F")] == [[1, 1]]
    assert table_of("xlsx", path, "F").doubts == ()
    assert [table.element for table in tables_of("xlsx", path, "F", sheet="*")] == ["now"]
    assert list(table_of("xlsx", path, "F", sheet="old").columns["F"]) == [-1, -1]


def test_which_of_several_sheets_was_read_is_told(tmp_path):
    path = hidden(tmp_path / "a.xlsx", "old", old=OLD, now=NOW, next=NEXT, empty=[])
    assert table_of("xlsx", path, "F").doubts == (
        "a.xlsx: the sheet 'now' is read, and not next; name the sheet to read with `sheet`",
    )
    assert table_of("xlsx", path, "F", sheet="now").doubts == ()


def test_hidden_rows_and_columns_are_told_or_left_out(tmp_path):
    path = tmp_path / "a.xlsx"
    made = workbook(path, a=[["t", "F", "G"], *([i, 10 * i, 0] for i in range(5))])
    for row in (3, 5):
        made["a"].row_dimensions[row].hidden = True
    made["a"].column_dimensions["B"].hidden = True
    made.save(path)
    kept = table_of("xlsx", path, "t", "G")
    assert [*kept.rows] == [2, 3, 4, 5, 6]
    assert [told.partition(";")[0] for told in kept.doubts] == [
        "a.xlsx:a: 2 hidden rows are read (first: row 3)"
    ]
    shown = table_of("xlsx", path, "F", hidden="drop")
    assert ([*shown.rows], shown.columns["F"].tolist()) == ([2, 4, 6], [0, 20, 40])
    assert shown.doubts == ("a.xlsx:a: the column 'F' is hidden in the workbook, and is read",)
    for row in range(2, 7):
        made["a"].row_dimensions[row].hidden = True
    made.save(path)
    refusal(["no row that is shown", "`hidden: drop`"], "xlsx", path, "t", hidden="drop")
