"""What exports say and refuse, and when code counts as equal to `predict`, by hand."""

import io
import zipfile
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from export_samples import WITH_MEMORY, formula, pieces
from scipy.io import loadmat

from mapmore_cli.annexes.exporting import fmu, table, verifying
from mapmore_cli.annexes.exporting.c_source import c_source
from mapmore_cli.annexes.exporting.exports import EXPORTERS, exported, names_of_files, snippet
from mapmore_cli.annexes.exporting.templates import notes_of
from mapmore_cli.domain.errors import MapmoreError, UsageError
from mapmore_cli.domain.recording import BaseUnits, Quantity

# Comparison with `predict`
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "factor", "more", "bit", "equal"),
    [
        (3, 1 + 0.9e-6, 0, 0, True),
        (3, 1 + 1.1e-6, 0, 0, False),
        (3, 1 - 1.1e-6, 0, 0, False),
        (99, 1, 0.9e-6, 0, True),  # a tenth of the median is 1
        (99, 1, 1.1e-6, 0, False),
        (3, 1, 0, 2, False),
        (3, 1, 0, 4, True),  # a bit of no input
        (3, np.nan, 0, 0, False),
        (50, 1, np.nan, 0, True),
    ],
)
def test_code_is_equal_within_a_millionth_and_has_the_same_flags(
    place, factor, more, bit, equal, monkeypatch, tmp_path
):
    expected = np.full(100, 10.0)
    expected[[50, 99]] = np.nan, 1e-9
    monkeypatch.setattr(verifying, "simulate", lambda *_: SimpleNamespace(values=expected))
    monkeypatch.setattr(verifying, "outside_range", lambda *_: np.zeros(100, dtype=bool))
    answers, bits = expected.copy(), np.zeros(100)
    answers[place] = answers[place] * factor + more
    bits[place] = bit
    given = []
    monkeypatch.setattr(
        verifying,
        "_answers",
        lambda _model, _command, text, _folder: (
            given.append(text) or np.column_stack([answers, bits]).ravel()
        ),
    )
    model = formula("sarosi")
    if equal:
        verifying._verify(model, [], tmp_path)
    else:
        columns = verifying.points(model)
        at = f"at pressure = {columns['pressure'][place]:.6g}, strain = "
        with pytest.raises(MapmoreError, match=f"`predict` gives .* {at}"):
            verifying._verify(model, [], tmp_path)
    assert len(given[0].splitlines()) == 100


def test_points_lie_in_the_training_range_and_a_fifth_around_it():
    model = pieces()
    columns, ends = verifying.points(model), verifying.training_ends(model)
    for name, (lows, highs) in ends.items():
        low, high = min(lows), max(highs)
        shares = (columns[name] - low) / (high - low)
        assert -0.2 <= shares.min() < -0.1
        assert 1.1 < shares.max() <= 1.2
    memory = WITH_MEMORY["fed back"]
    columns = verifying.points(memory)
    assert np.diff(columns["time"]) == pytest.approx(memory.memories[0].states.step)
    low, high = memory.memories[0].limits
    assert low <= columns[memory.output.name].min() < columns[memory.output.name].max() <= high


def test_the_middle_is_that_of_the_range_of_all_levels(monkeypatch):
    ends = {"a": ([0.0, 1.0], [4.0, 3.0]), "b": ([], []), "c": ([1.23456], [2.0])}
    monkeypatch.setattr(verifying, "training_ends", lambda _model: ends)
    assert verifying.middle(None) == {"a": 2, "b": 0, "c": 1.617}


@pytest.mark.parametrize(
    ("system", "machine", "places"),
    [
        ("linux", "x86_64", ("linux64/m.so", "x86_64-linux/m.so")),
        ("win32", "AMD64", ("win64/m.dll", "x86_64-windows/m.dll")),
        ("darwin", "arm64", ("darwin64/m.dylib", "aarch64-darwin/m.dylib")),
        ("linux", "aarch64", (None, "aarch64-linux/m.so")),
        ("linux", "i686", ("linux64/m.so", "x86-linux/m.so")),  # of a Python of 64 bits
        ("linux", "sparc", (None, None)),
        ("plan9", "x86_64", (None, None)),
    ],
)
def test_the_library_of_a_unit_lies_where_the_standard_says(system, machine, places, monkeypatch):
    monkeypatch.setattr(verifying.sys, "platform", system)
    monkeypatch.setattr(verifying.platform, "machine", lambda: machine)
    for standard, place in zip((2, 3), places, strict=True):
        if place is None:
            with pytest.raises(verifying.CompilerMissing, match="has no name for this machine"):
                verifying.library_place("m", standard)
        else:
            assert verifying.library_place("m", standard) == f"binaries/{place}"


# What files say
# --------------------------------------------------------------------------------------------------


def test_variables_of_a_unit_say_what_they_are(monkeypatch):
    pressure, strain, force, bits = fmu._variables(c_source(pieces()), [fmu.BITS])
    assert (pressure.about, pressure.start) == ("Trained from 100 to 500 kPa", 100)
    assert (strain.about, strain.start) == ("Trained from 0 to 0.35 1", 0)
    assert (force.about, force.causality, force.start) == ("The model's value", "output", None)
    words = "0, or the sum of 1 for pressure, 2 for strain outside of its training range"
    assert (bits.about, bits.variability) == (words, "discrete")
    assert {one.variability for one in (pressure, strain, force)} == {"continuous"}
    monkeypatch.setattr(fmu, "training_ends", lambda _model: {"pressure": ([-5.0], [-2.0])})
    below = replace(pieces(), inputs=(Quantity("pressure", "kPa"), Quantity("time", "1")))
    written = SimpleNamespace(
        words={"model": below, "memory": True},
        program=SimpleNamespace(kept=SimpleNamespace(fed_back=("force",))),
    )
    pressure, time, measured, _, bits = fmu._variables(written, [fmu.BITS, "time"])
    assert pressure.start == -2
    assert (time.name, time.about) == ("time_2", "time. An input")
    assert measured.about.startswith("Measured output with which")
    assert bits.about.endswith(", 4 if there is no value yet or the run has diverged")
    assert measured.variability == "discrete"


@pytest.mark.parametrize(
    ("factor", "offset", "scale"),
    [
        (1.0, 0.0, {}),
        (10.0, 0.0, {"factor": 10.0}),
        (1.0, 273.15, {"offset": 273.15}),
        (0.0, 1.0, {"factor": 0.0, "offset": 1.0}),
    ],
)
def test_a_unit_of_measurement_states_a_factor_and_an_offset_that_differ_from_the_base_units(
    factor, offset, scale
):
    assert fmu._powers(BaseUnits(factor, offset, {"K": 1})) == {"K": 1, **scale}


def test_files_of_a_unit_can_be_read_and_its_library_run(monkeypatch):
    monkeypatch.setattr(fmu, "built", lambda *_: b"library")
    ((_, data),) = exported(pieces(), "fmu", verify=False).items()
    for entry in zipfile.ZipFile(io.BytesIO(data)).infolist():
        expected = 0o755 if entry.filename.startswith("binaries/") else 0o644
        assert (entry.external_attr >> 16, entry.create_system) == (expected, 3)


def test_an_inverse_in_c_has_room_for_the_parts_of_the_input_that_has_the_most():
    inverse = c_source(pieces()).files["dmsp_20_inverse.c"]
    # 40 intervals between knots, each in 3 parts, whose 4 ends may all be doubled; 64 are divided
    assert f"#define PLACES {2 * 40 * 4 + 1 + 2 * 64} " in inverse


def test_notes_name_inputs_that_are_called_otherwise_and_the_shape():
    model = SimpleNamespace(shape=None, output=Quantity("force", "N"), memories=())
    assert notes_of(model, {"a": "a", "b": "b_2"}) == ["The input b is called b_2 here."]
    model.shape = SimpleNamespace(kept=(), promise="increasing")
    assert notes_of(model, {}) == []
    model.shape.kept = (1,)
    assert notes_of(model, {}) == ["The force is increasing."]
    model.memories = (1,)
    assert notes_of(model, {}) == ["The force at rest is increasing."]


def test_forms_without_a_call_have_no_snippet_and_unknown_forms_are_refused():
    assert snippet(pieces(), "csv", ["a.csv"]) == ""
    with pytest.raises(UsageError, match="there is no export to 'cobol'"):
        exported(pieces(), "cobol")


@pytest.mark.parametrize("to", [form for form, row in EXPORTERS.items() if row.endings])
def test_c_and_latex_hold_all_outputs_and_other_forms_have_files_for_each(to):
    outputs = [SimpleNamespace(name="a"), SimpleNamespace(name="b")]
    names = names_of_files(SimpleNamespace(name="both", each=outputs), to)
    assert {name[0] for name in names} == ({"b"} if to in ("c", "tex") else {"a", "b"})
    assert any(name.startswith("both") for name in names) == (to in ("c", "tex"))


def test_an_integer_has_bits_for_fourteen_inputs_and_one_more():
    model, extra = formula("sarosi"), [Quantity(f"i{k}", "1") for k in range(13)]
    assert c_source(replace(model, inputs=(*model.inputs, *extra[:12])))
    with pytest.raises(UsageError, match="has 15 inputs, but a model in C can have at most 14"):
        c_source(replace(model, inputs=(*model.inputs, *extra)))
    with pytest.raises(UsageError, match="the strain as a fraction and the force in N"):
        exported(replace(model, output=Quantity("force", "kN")), "mujoco")


# Tables
# --------------------------------------------------------------------------------------------------


def test_a_table_without_a_grid_has_the_levels_among_its_places():
    files = exported(pieces(), "table")
    found = loadmat(io.BytesIO(files["dmsp_20.mat"]))
    pressure, strain = found["pressure"].ravel(), found["strain"].ravel()
    levels = [curve.level for curve in pieces().body.curves]
    assert {*levels} <= {*pressure}
    assert (pressure[0], pressure[-1]) == (levels[0], levels[-1])
    assert 41 <= len(pressure) <= 41 + len(levels)
    lows, highs = verifying.training_ends(pieces())["strain"]
    np.testing.assert_allclose(strain, np.linspace(min(lows), max(highs), 41))
    assert files["dmsp_20.mat"][:116] == table.HEADER.ljust(116)


def test_a_table_that_is_too_large_is_refused(monkeypatch):
    monkeypatch.setattr(table, "MOST", 6)
    assert exported(pieces(), "table", grid="pressure=100:300:100,strain=0.03:0.05:0.02")
    with pytest.raises(UsageError, match="more than 6 points"):
        exported(pieces(), "table", grid="pressure=100:400:100,strain=0.03:0.05:0.02")
    with pytest.raises(UsageError, match=r"1 of 3 points lie outside .* example 0,0.05"):
        exported(pieces(), "csv", grid="pressure=0:400:200,strain=0.05")
