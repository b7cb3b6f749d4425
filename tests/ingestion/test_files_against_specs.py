"""Where a file says something else of its columns than the spec: an error with the remedy, or a
warning.
"""

import io
from contextlib import nullcontext

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reading import refused, workbook

from mapmore_cli.domain.errors import DataError
from mapmore_cli.study.units import is_same, unit_of_file

N = 40


def hdf5(**units):
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        for name, scale in (("t", 0.1), ("P", 1.0), ("eps", 0.001), ("F", 2.0)):
            file[name] = scale * np.arange(float(N))
            if name in units:
                file[name].attrs["units"] = units[name]
    return stream.getvalue()


def columns(**changes):
    own = {"time": "t", "pressure": "P", "strain": "eps", "force": "F"}
    return {name: {"column": column, **changes.get(name, {})} for name, column in own.items()}


def read(ingest, content, **data):
    warnings = []
    made = ingest({"a.h5": content}, files=["a.h5"], reader="hdf5", warnings=warnings, **data)
    return dict(made.recordings[0].columns), warnings


@pytest.mark.parametrize(
    ("units", "spec"),
    [
        ({"P": "kilopascal", "F": "newton", "t": "seconds"}, {}),
        ({"P": "kPa", "t": "seconds since 2020-01-01 00:00:00"}, {}),
        ({"P": "bar"}, {"pressure": {"unit": "bar"}}),
        ({"P": "BAR"}, {"pressure": {"unit": "bar"}}),
        ({"P": "psig"}, {"pressure": {"unit": "psi"}}),
        ({"P": "[kPa]", "eps": "mm/mm", "F": ""}, {}),
        ({"t": "days since 2020-01-01"}, {"time": {"unit": "days"}}),
        ({"P": "V"}, {"pressure": {"scale": 25.0, "unit": "kPa"}}),
        ({"P": "bar"}, {"pressure": {"scale": 1, "unit": "kPa"}}),
    ],
    ids=str,
)
def test_units_that_mean_the_same_or_that_a_scale_explains(ingest, units, spec):
    assert read(ingest, hdf5(**units), columns=columns(**spec))[1] == []


@pytest.mark.parametrize(
    ("units", "spec", "told"),
    [
        (
            {"P": "bar"},
            {"pressure": {"unit": "kPa"}},
            "a.h5: 'P' is in bar according to the file, but is read as pressure in kPa\n"
            "  write `unit: bar`",
        ),
        ({"P": "bar"}, {}, "'P' is in bar"),
        ({"P": "Bar"}, {"pressure": {"scale": -1}}, "write `unit: bar`"),
        ({"P": "psi (gauge)"}, {}, "write `unit: psi`"),
        ({"P": "V"}, {}, "set `scale` to the factor from the numbers to kPa"),
        ({"F": "kg"}, {}, "'F' is in kg"),
        ({"F": "kN"}, {"force": {"offset": 3.0}}, "write `unit: kN`"),
        ({"eps": "%"}, {}, "'eps' is in %"),
        ({"t": "ms"}, {}, "'t' is in ms"),
        ({"t": "days since 2020-01-01"}, {}, "write `unit: days`"),
    ],
    ids=str,
)
def test_units_that_the_file_contradicts(ingest, units, spec, told):
    with refused(told):
        read(ingest, hdf5(**units), columns=columns(**spec))


@pytest.mark.parametrize("word", ["counts", "a.u.", "Messwert", "m**9**9**9"])
def test_words_that_nobody_knows_are_told(ingest, word):
    assert read(ingest, hdf5(F=word), columns=columns())[1] == [
        f"a.h5: 'F' is in '{word}' according to the file, but is read in N; "
        "check `unit`, because the unit of the file is unknown here"
    ]


def test_a_factor_of_the_file_and_one_of_the_spec(ingest):
    stream = io.BytesIO(hdf5())
    with h5py.File(stream, "a") as file:
        file["F"].attrs["scale_factor"] = 0.1
    for scale in (1.0, -1.0):
        assert read(ingest, stream.getvalue(), columns=columns(force={"scale": scale}))[1] == []
    _, warnings = read(ingest, stream.getvalue(), columns=columns(force={"scale": 0.1}))
    assert warnings == [
        "a.h5: 'F' is scaled by the file itself, and `scale: 0.1` scales it again; remove `scale` "
        "if only one of the two is meant"
    ]


def test_a_quantity_without_a_usual_unit_may_have_any_unit_unless_the_spec_gives_one(ingest):
    """A strain is a fraction, although it has no unit either."""
    for name, own in (("duty", {}), ("input", {}), ("duty", {"unit": "1"})):
        asked = {
            "pressure": {"column": "P"},
            "force": {"column": "F"},
            name: {"column": "eps", **own},
        }
        with refused("'eps' is in V") if own else nullcontext():
            assert read(ingest, hdf5(eps="V"), columns=asked)[1] == []


def test_units_by_meaning():
    assert not is_same("degC", "K")
    words = {
        "M": "m",
        "S": "s",
        "mmhg": "mmHg",
        "KPA": "kPa",
        "Newton": "N",
        "kPa(g)": "kPa",
        "bara": "bara",
        "psig": "psi",
    }
    assert {word: unit_of_file(word, unit) for word, unit in words.items()} == words


@given(
    st.one_of(st.text(max_size=12), st.text("kMmPaNbarsig/*^ 0123456789%()·°CdBV-", max_size=8)),
    st.sampled_from(["kPa", "1", "s", "K"]),
)
def test_any_word_is_a_unit_or_not(word, unit):
    found = unit_of_file(word, unit)
    assert found is None or is_same(found, unit) in (True, False)


# LabVIEW
# --------------------------------------------------------------------------------------------------


def tdms(step_of_force=0.01, start=0, step=0.01):
    nptdms = pytest.importorskip("nptdms")
    stream = io.BytesIO()
    with nptdms.TdmsWriter(stream) as writer:
        for name, dt, late, unit in (
            ("P", step, 0, "kPa"),
            ("eps", step, 0, ""),
            ("F", step_of_force, start, "N"),
        ):
            said = {
                "wf_increment": dt,
                "wf_start_time": np.datetime64("2026-03-01", "ms") + np.timedelta64(late, "ms"),
                "unit_string": unit,
            }
            values = (0.01 if name == "eps" else 1.0) * (np.arange(N) * dt + late / 1000)
            writer.write_segment([nptdms.ChannelObject("G", name, values, said)])
    return stream.getvalue()


LABVIEW = {
    name: {"column": f"G/{column}"}
    for name, column in (("pressure", "P"), ("strain", "eps"), ("force", "F"))
}
TDMS = {"files": ["a.tdms"], "reader": "tdms"}


def test_the_remedy_brings_channels_of_two_rates_together(ingest):
    content = {"a.tdms": tdms(0.009, 100)}
    with pytest.raises(
        DataError,
        match=r"every 0\.01 s, 'G/F' every 0\.009 s\n.*`sample_time: 0\.009 s` and `shift: 0\.1 s`",
    ):
        ingest(content, **TDMS, columns=LABVIEW, sample_time=0.01)
    join = {**TDMS, "columns": {"force": LABVIEW["force"]}, "sample_time": 0.009, "shift": 0.1}
    own = {name: LABVIEW[name] for name in ("pressure", "strain")}
    made = (
        ingest(content, **TDMS, columns=own, sample_time=0.01, join=[join], missing="drop")
        .recordings[0]
        .columns
    )
    np.testing.assert_allclose(made["force"], made["pressure"], atol=1e-9)
    by_row = {**TDMS, "columns": {"force": LABVIEW["force"]}, "on": "row"}
    assert (
        ingest(content, **TDMS, columns=own, sample_time=0.01, join=[by_row])
        .recordings[0]
        .rows_kept
        == N
    )


def test_a_sample_time_agrees_with_the_file_up_to_a_thousandth(ingest):
    for step in (0.001, 0.01005):
        told = f"one sample every 0.01 s, but the spec every {step:g} s"
        with refused(told, "write `sample_time: 0.01 s`"):
            ingest({"a.tdms": tdms()}, **TDMS, columns=LABVIEW, sample_time=step)
    for step in (0.01, 0.010005):
        made = ingest({"a.tdms": tdms()}, **TDMS, columns=LABVIEW, sample_time=step)
        assert made.recordings[0].rows_kept == N


def test_a_second_is_what_labview_notes_where_nobody_says(ingest):
    warnings = []
    ingest(
        {"a.tdms": tdms(1.0, step=1.0)},
        **TDMS,
        columns=LABVIEW,
        sample_time=0.001,
        warnings=warnings,
    )
    assert warnings == [
        "a.tdms: the file gives one sample every 1 s, but the spec every 0.001 s, which is "
        "used, because LabVIEW writes 1 s if nobody has set a rate"
    ]


def test_cells_in_per_cent_are_fractions(ingest, tmp_path):
    """In workbooks of every kind, they are told: see `test_faults_of_files.py`."""
    rows = [["t", "P", "eps", "F"]]
    rows += [[0.1 * i, 100.0, 0.0625 + 0.005 * i, 2.0 * i] for i in range(N)]
    book = workbook(tmp_path / "book.xlsx", a=rows)
    for row in range(2, N + 2):
        book["a"][f"C{row}"].number_format = '0.00"%"' if row == 2 else "0.0 %"
    book.save(tmp_path / "book.xlsx")
    asked = {"files": ["book.xlsx"], "reader": "xlsx"}
    with refused("'eps' is shown in per cent", "`unit: 1`"):
        ingest({}, columns=columns(strain={"unit": "%"}), **asked)
    made = ingest({}, columns=columns(strain={"unit": "1"}), **asked)
    strain = made.recordings[0].columns["strain"]
    np.testing.assert_allclose(strain, [row[2] for row in rows[1:]])
