"""NumPy modules, tables and equations."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from agreement import difference, points, recording
from export_samples import STATIC, WITH_MEMORY, pieces

from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.numpy_module import numpy_module
from mapmore_cli.modelling.kinds import fed_back, outside_range, predict
from mapmore_cli.study.exports import exported


def imported(model: Model, folder: Path) -> ModuleType:
    name, text = numpy_module(model)
    assert [line for line in text.splitlines() if "import" in line] == ["import numpy as np"]
    (folder / name).write_text(text)
    spec = importlib.util.spec_from_file_location(name.removesuffix(".py"), folder / name)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", STATIC)
def test_a_module_of_numpy_alone(tmp_path: Path, name: str) -> None:
    model = STATIC[name]
    module, columns = imported(model, tmp_path), points(model, 3000)
    assert difference(module.evaluate(**columns), predict(model, columns)) < 1e-12
    assert np.array_equal(module.outside_range(**columns), outside_range(model, columns))


@pytest.mark.parametrize("name", WITH_MEMORY)
def test_a_module_with_memory(tmp_path: Path, name: str) -> None:
    model = WITH_MEMORY[name]
    module, columns = imported(model, tmp_path), recording(model, 300)
    state = module.State()
    found = []
    for row in range(300):
        found.append(module.step(state, **{one: columns[one][row] for one in module.INPUTS}))
        if fed_back(model) and np.isnan(found[-1]) and row < 10:
            state.measured(columns["force"][row])
    with np.errstate(all="ignore"):
        expected = predict(model, columns)
    assert difference(np.array(found), expected) < 1e-12


def test_one_sample_and_a_sample_that_is_not_finite(tmp_path: Path) -> None:
    module = imported(pieces(), tmp_path)
    assert module.evaluate(200.0, 0.1) == pytest.approx(predict(pieces(), {"pressure": np.array([200.0]), "strain": np.array([0.1])})[0])
    assert np.isnan(module.evaluate(np.nan, 0.1))


def test_a_table_has_the_points_of_its_grid() -> None:
    files = exported(pieces(), "csv", grid="pressure=100:500:100,strain=0.03:0.19:0.04")
    header, *rows = files["dmsp_20.csv"].decode().splitlines()
    assert header == "pressure,strain,force_predicted"
    assert len(rows) == 25
    numbers = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    expected = predict(pieces(), {"pressure": numbers[:, 0].copy(), "strain": numbers[:, 1].copy()})
    assert np.allclose(numbers[:, 2], expected, rtol=1e-11, atol=0)


def test_a_grid_beyond_the_training_range_is_refused() -> None:
    with pytest.raises(UsageError, match="outside of the training range"):
        exported(pieces(), "csv", grid="pressure=0:500:100,strain=0.03:0.19:0.04")
    with pytest.raises(UsageError, match="memory"):
        exported(WITH_MEMORY["lags"], "csv", grid="pressure=0:500:100,strain=0.03:0.19:0.04")


def test_equations_in_latex() -> None:
    text = exported(pieces(), "tex")["dmsp_20.tex"].decode()
    assert text.count(r"\[") == text.count(r"\]") == 12
    assert text.startswith("% dmsp-20: force in N, pressure in kPa, strain in 1")


@pytest.mark.parametrize("to", ["tex", "c", "py"])
def test_coefficients_that_multiply_to_no_number_are_told(to: str) -> None:
    """Found by fuzzing: a file that somebody changed, shown or exported unverified, was an internal fault."""
    model = pieces()
    (curve, *others) = model.body.curves
    (segment, *rest) = curve.segments
    huge = replace(segment, theta=1e200 * segment.theta, scaling=replace(segment.scaling, y_slope=1e200))
    body = replace(model.body, curves=(replace(curve, segments=(huge, *rest)), *others))
    with pytest.raises(DataError, match=r"dmsp-20 cannot be written out: -?inf is not a finite number"):
        exported(replace(model, body=body), to)
