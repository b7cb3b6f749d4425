"""NumPy modules, tables, equations, and what simulators read: SciPy's MAT reader, MuJoCo, a C
compiler, Python without NumPy.
"""

import ctypes
import io
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from agreement import difference, imported, points, recording
from common import NO_OCTAVE, OCTAVE, python
from export_samples import STATIC, WITH_MEMORY, pieces
from replay import Lift, by_octave, combi_tables, compiled
from scipy.interpolate import RegularGridInterpolator
from scipy.io import loadmat

import mapmore_cli as mm
from mapmore_cli.annexes.exporting.commands import export
from mapmore_cli.annexes.exporting.exports import EXPORTERS, Form, exported, names_of_files
from mapmore_cli.annexes.exporting.templates import NOTICE
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.modelling.programs import slopes

ROOT = Path(__file__).resolve().parents[2]
SNIPPETS = ROOT / "mapmore_cli/annexes/exporting/sources/snippets"
DATA = (".csv", ".mat", ".txt", ".tex", ".xml", ".so", ".dll", ".dylib", "")
"""Endings of exported files that hold no code of mapmore."""


@pytest.mark.parametrize("name", STATIC)
def test_a_module_of_numpy_alone(name):
    model = STATIC[name]
    module, columns = imported(model), points(model, 3000)
    assert difference(module.evaluate(**columns), predict(model, columns)) < 1e-12
    assert np.array_equal(module.outside_range(**columns), outside_range(model, columns))


needs_octave = pytest.mark.skipif(OCTAVE is None, reason=NO_OCTAVE)


@needs_octave
@pytest.mark.parametrize("name", ["two levels", "fed back", "without a value"])
def test_a_function_of_matlab_by_octave(name, tmp_path):
    """Columns in one call, and with memory in two calls that hand the state on; NaN where MATLAB's
    own logarithms and roots are complex.
    """
    roots = ("log(strain)", "sqrt(strain)", "log1p(strain - 1)", "strain^1.5")
    model = (STATIC | WITH_MEMORY | {"without a value": pieces(terms=roots)})[name]
    columns = (recording if name in WITH_MEMORY else points)(model, 300)
    assert difference(by_octave(model, columns, tmp_path), predict(model, columns)) < 1e-12


@pytest.mark.parametrize(
    ("to", "file", "program"), [("matlab", "dmsp_20.m", "Octave"), ("js", "dmsp_20.mjs", "Node")]
)
def test_code_that_no_program_here_runs_is_written_with_a_warning(to, file, program, monkeypatch):
    monkeypatch.setenv("PATH", "")
    warnings = []
    assert [*exported(pieces(), to, warn=warnings.append)] == [file]
    assert f"{program} is not installed" in warnings[0]


def test_one_sample_and_a_sample_that_is_not_finite():
    module = imported(pieces())
    assert module.evaluate(200.0, 0.1) == pytest.approx(
        predict(pieces(), {"pressure": np.array([200.0]), "strain": np.array([0.1])})[0]
    )
    assert np.isnan(module.evaluate(np.nan, 0.1))


def test_a_table_has_the_points_of_its_grid():
    files = exported(pieces(), "csv", grid="pressure=100:500:100,strain=0.03:0.19:0.04")
    header, *rows = files["dmsp_20.csv"].decode().splitlines()
    assert header == "pressure,strain,force_predicted"
    assert len(rows) == 25
    numbers = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    expected = predict(pieces(), {"pressure": numbers[:, 0].copy(), "strain": numbers[:, 1].copy()})
    assert np.allclose(numbers[:, 2], expected, rtol=1e-11, atol=0)


def test_equations_in_latex():
    text = exported(pieces(), "tex")["dmsp_20.tex"].decode()
    assert text.count(r"\[") == text.count(r"\]") == 12
    for words in ("weight: strain falls", r"z\_s = 0.25", r"\begin{tabular}", "pressure to {[}kPa"):
        assert words in text
    assert text.startswith("% dmsp-20: force in N, pressure in kPa, strain in 1")


@pytest.mark.parametrize("to", ["tex", "c", "py"])
def test_coefficients_that_multiply_to_no_number_are_told(to):
    """Found by fuzzing: a file that somebody changed, shown or exported unverified, was an internal
    fault.
    """
    model = pieces()
    (curve, *others) = model.body.curves
    (segment, *rest) = curve.segments
    huge = replace(
        segment, theta=1e200 * segment.theta, scaling=replace(segment.scaling, y_slope=1e200)
    )
    body = replace(model.body, curves=(replace(curve, segments=(huge, *rest)), *others))
    with pytest.raises(
        DataError, match=r"dmsp-20 cannot be written as equations: -?inf is not a finite number"
    ):
        exported(replace(model, body=body), to)


PLACES = np.random.default_rng(3).uniform([0.0, -0.02], [400.0, 0.3], (200, 2))


@pytest.fixture(scope="module")
def model():
    """A muscle that is stiff at first, fitted by pieces on a backbone."""
    pressure, strain = (
        grid.ravel()
        for grid in np.meshgrid([0.0, 100, 200, 300, 400], np.linspace(0, 0.25, 40), indexing="ij")
    )
    force = 1.8 * pressure * (1 - 3.0 * strain) ** 2 - 60 * strain + 20 * np.exp(-strain / 0.02)
    frame = {"pressure": pressure, "strain": strain, "force": force}
    terms = [{"polynomial": {"of": ["strain"], "order": 3}}]
    levels = {"of": "pressure", "at": "auto"}
    return mm.fit(
        frame,
        name="muscle",
        levels=levels,
        segment={"strain": {"method": "even", "count": 3}},
        dictionary=terms,
    ).model


def columns():
    return {"pressure": PLACES[:, 0], "strain": PLACES[:, 1]}


def test_every_file_of_code_names_the_licence(model):
    copyright_line = next(
        line for line in (ROOT / "LICENSE").read_text().splitlines() if "Copyright" in line
    )
    assert copyright_line in NOTICE
    for to in EXPORTERS:
        grid = "pressure=100:200:50,strain=0:0.1:0.05" if to == "csv" else None
        files = exported(model, to, grid=grid, verify=False)
        assert set() < {*names_of_files(model, to)} <= {*files}
        if to.startswith("fmu"):
            with zipfile.ZipFile(io.BytesIO(*files.values())) as archive:
                files = {name: archive.read(name) for name in archive.namelist()}
        for name, content in files.items():
            assert (NOTICE.encode() in content) is (Path(name).suffix not in DATA), name


def test_every_form_is_in_the_help_and_its_template_of_a_call_exists():
    templates = {path.name.removesuffix(".jinja") for path in SNIPPETS.iterdir()}
    assert {form.snippet for form in EXPORTERS.values()} == {"", *templates}
    assert [to for to in EXPORTERS if f"`{to}`" not in export.__doc__] == []


def test_the_table_is_the_model(model, tmp_path):
    """CSV, MAT and Modelica's text say the same, and what is read from the MAT file is
    `predict`.
    """
    files = exported(model, "table")
    assert files == exported(model, "table")  # no date in it
    stem = next(iter(files)).removesuffix(".csv")
    (tmp_path / "table.mat").write_bytes(files[f"{stem}.mat"])
    table = loadmat(tmp_path / "table.mat")
    pressure, strain = table["pressure"].ravel(), table["strain"].ravel()
    points = {
        "pressure": np.repeat(pressure, len(strain)),
        "strain": np.tile(strain, len(pressure)),
    }
    np.testing.assert_array_equal(table["force"].ravel(), predict(model, points))
    np.testing.assert_array_equal(table["valid"].ravel(), ~outside_range(model, points))
    rows = np.genfromtxt(files[f"{stem}.csv"].decode().splitlines(), delimiter=",", names=True)
    np.testing.assert_allclose(rows["force_predicted"], table["force"].ravel(), rtol=1e-11)
    looked_up = RegularGridInterpolator((pressure, strain), table["force"])
    inside = (
        ~outside_range(model, columns())
        & (PLACES[:, 0] <= pressure[-1])
        & (PLACES[:, 1] <= strain[-1])
    )
    error = looked_up(PLACES[inside]) - predict(
        model, {name: x[inside] for name, x in columns().items()}
    )
    assert np.abs(error).max() < 0.05 * np.ptp(table["force"])


def test_modelica_reads_both_tables(model):
    """By the grammar of ModelicaStandardTables: `#1`, then `double name(rows,columns)` and its
    numbers.
    """
    files = exported(model, "table", grid="pressure=100:300:50,strain=0:0.2:0.05")
    tables = combi_tables(
        next(text for name, text in files.items() if name.endswith(".txt")).decode()
    )
    assert set(tables) == {"force", "valid"}
    (rows, columns), force = tables["force"]
    np.testing.assert_allclose(rows, [100, 150, 200, 250, 300])
    np.testing.assert_allclose(columns, [0, 0.05, 0.1, 0.15, 0.2])
    expected = predict(
        model, {"pressure": np.full(5, 150.0), "strain": np.array([0, 0.05, 0.1, 0.15, 0.2])}
    )
    np.testing.assert_allclose(force[1], expected, rtol=1e-14)


def test_the_python_file_needs_nothing(model, tmp_path):
    """A process that can import no NumPy has the same numbers and derivatives."""
    files = exported(model, "py")
    (tmp_path / "muscle.py").write_bytes(next(iter(files.values())))
    code = (
        "import sys; sys.modules['numpy'] = None\nimport muscle\n"
        "for line in sys.stdin:\n"
        "    p, e = map(float, line.split())\n"
        "    print(repr(muscle.force(p, e)), *map(repr, muscle.derivatives(p, e)), "
        "int(muscle.outside_range(p, e)))\n"
    )
    given = "\n".join(f"{p!r} {e!r}" for p, e in PLACES.tolist())
    done = python(code, input=given, check=True, cwd=tmp_path)
    found = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    np.testing.assert_allclose(found[:, 0], predict(model, columns()), rtol=1e-12)
    expected = slopes(model, columns())
    np.testing.assert_allclose(found[:, 1], expected["pressure"], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found[:, 2], expected["strain"], rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(found[:, 3], outside_range(model, columns()))


def test_simulinks_function_is_the_model(model, tmp_path):
    library, name = compiled(exported(model, "simulink"), tmp_path)
    for function in (
        force := getattr(library, f"{name}_force"),
        valid := getattr(library, f"{name}_valid"),
    ):
        function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * 2
    np.testing.assert_allclose(
        [force(*row) for row in PLACES], predict(model, columns()), rtol=1e-12
    )
    np.testing.assert_array_equal([valid(*row) for row in PLACES], ~outside_range(model, columns()))


def test_mujoco_lifts_a_weight_with_the_muscle(model, tmp_path):
    """The C callback in MuJoCo: the weight comes to rest where `predict` has its weight, at every
    pressure.
    """
    mass = 12.0
    with Lift(model, tmp_path, mass) as lift:
        for pressure in (200.0, 300.0):
            lift.data.ctrl[0] = pressure
            for _ in range(6000):
                lift.mujoco.mj_step(lift.world, lift.data)
            strain = 1 - lift.data.actuator_length[0] / 0.2
            assert abs(lift.data.qvel[0]) < 1e-3
            assert 0.005 < strain < 0.3
            found = predict(
                model, {"pressure": np.array([pressure]), "strain": np.array([strain])}
            )[0]
            assert found == pytest.approx(mass * 9.81, rel=1e-3)


def test_what_a_simulator_cannot_hold():
    memory = WITH_MEMORY["lags"]
    for target in ("csv", "table", "mujoco", "simulink"):
        with pytest.raises(UsageError, match=r"memory|the force with the inputs pressure"):
            exported(memory, target)


def test_a_python_file_with_memory_goes_on_from_a_state():
    memory, code = WITH_MEMORY["lags"], {}
    columns = recording(memory, 60)
    exec(next(iter(exported(memory, "py").values())), code)
    state = code["reset"]()
    rows = zip(*(columns[quantity.name] for quantity in memory.inputs), strict=True)
    found = np.array([code["force"](*row, state) for row in rows])
    assert difference(found, predict(memory, columns)) < 1e-12


@pytest.mark.parametrize(
    ("files", "words"),
    [
        (["a"], "returns list instead of files by name"),
        ({"a.c": "", "../b.c": ""}, "names the file '../b.c', which is not a plain name"),
        ({"/tmp/b.c": ""}, "names the file '/tmp/b.c'"),
    ],
)
def test_a_plugin_writes_files_of_plain_names(files, words, monkeypatch):
    monkeypatch.setitem(EXPORTERS, "odd", Form(lambda _model, _wanted: files))
    with pytest.raises(UsageError, match=f"the plug-in of the export 'odd' {words}"):
        exported(pieces(), "odd")
