"""A model of the pressure and one of the force as one actuator: equal to the one after the other,
in C and as a unit.
"""

from dataclasses import replace

import numpy as np
import pytest
from agreement import recording
from export_samples import OPERATORS, PRESSURE, WITH_MEMORY, formula, memory, motion, pieces
from test_fmu_export import checked, greatest_difference, needs_compiler
from typer.testing import CliRunner

from mapmore_cli.annexes.motion.body import StateSpace
from mapmore_cli.annexes.sums.joint import actuator
from mapmore_cli.cli.app import app
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryModel, StateSet
from mapmore_cli.domain.models import Memory, Model
from mapmore_cli.domain.recording import CurveRange, Quantity, Signal
from mapmore_cli.modelling.kinds import (
    outside_range,
    predict,
)
from mapmore_cli.storage.artefacts import write_model

VALVE = Quantity("input", "V")
RANGE = (CurveRange("a", None, {"input": (0.0, 10.0)}),)


def called(*args):
    return CliRunner().invoke(app, [str(arg) for arg in args])


def lag():
    """P's state space from the input of a valve to the pressure."""
    body = motion("bumpless", directed=False, dead_band=0.0).body
    sections = tuple(
        replace(one, weights=np.array([1.5 + i])) for i, one in enumerate(body.motion.sections)
    )
    found = replace(
        body.motion,
        input="input",
        output="pressure",
        drives=("input",),
        sections=sections,
        boundaries=(5.0,),
    )
    return Model("lag", PRESSURE, (VALVE,), StateSpace(found, RANGE))


def delayed(*states):
    """A model with memory from the input of a valve to the pressure."""
    ranges = {"input": (0.0, 10.0), "pressure[k-1]": (0.0, 600.0)}
    found = StateSet(states, 0.01, ranges, {}, np.empty(0), np.empty(0), 0.15)
    theta = np.full(len(states), 20.0)
    return Model(
        "delayed",
        PRESSURE,
        (VALVE,),
        Memory(MemoryModel("pressure", found, states, theta, theta, 30.0, (-100.0, 900.0)), RANGE),
    )


PAIRS = {
    "lag, static": (pieces(), lag()),
    "delay, static": (pieces(), delayed("input[k-4]", "slow(input, 0.05)")),
    "lag, memory": (memory(OPERATORS, OPERATORS), lag()),
    "delay, memory": (WITH_MEMORY["lags"], delayed("input[k-2]", "input")),
}


@needs_compiler
@pytest.mark.parametrize(
    "name",
    [
        "lag, static",
        "delay, memory",
        *(pytest.param(one, marks=pytest.mark.long) for one in ("delay, static", "lag, memory")),
    ],
)
def test_a_unit_is_the_force_at_the_predicted_pressure(tmp_path, name):
    force, pressure = PAIRS[name]
    model = actuator(force, pressure)
    assert [quantity.name for quantity in model.inputs] == ["input", "strain"]
    columns = recording(model, 600)
    columns["input"][300] = np.nan  # both begin anew
    expected = predict(force, {**columns, "pressure": predict(pressure, columns)})
    assert np.isfinite(expected).sum() > 500
    assert greatest_difference(predict(model, columns), expected) == 0
    found, known = checked(model, tmp_path, columns), np.isfinite(expected)
    assert np.array_equal(
        (found["outside_range"] & 3 != 0)[known], outside_range(model, columns)[known]
    )


@needs_compiler
def test_an_actuator_is_written_by_one_command(tmp_path):
    force, pressure = PAIRS["lag, static"]
    for name, model in (("force", force), ("pressure", pressure)):
        write_model(tmp_path / f"{name}.h5", model)
    for to, written in (("c", "dmsp_20_actuator.c"), ("fmu", "dmsp_20_actuator.fmu")):
        done = called(
            "export",
            tmp_path / "force.h5",
            "--pressure",
            tmp_path / "pressure.h5",
            "--to",
            to,
            "-o",
            tmp_path / to,
        )
        assert done.exit_code == 0, done.stderr
        assert (tmp_path / to / written).is_file()
    refused = called(
        "export", tmp_path / "force.h5", "--pressure", tmp_path / "pressure.h5", "--to", "py"
    )
    assert refused.exit_code == 2
    assert "--pressure works with" in refused.stderr


def test_what_cannot_be_joined_is_refused():
    force = pieces()
    needing_rate = replace(force, signals=(Signal("pressure_rate", "rate", "pressure"),))
    for one, other, words in (
        (formula("reynolds"), lag(), "does not depend on pressure"),
        (
            replace(force, inputs=(Quantity("pressure", "bar"), force.inputs[1])),
            lag(),
            "does not depend on pressure in kPa",
        ),
        (needing_rate, lag(), "needs pressure_rate"),
        (force, delayed("pressure[k-1]", "input"), "starts from measured values of pressure"),
        (
            replace(force, inputs=(*force.inputs, Quantity("input", "mV"))),
            lag(),
            "have input in different units",
        ),
    ):
        with pytest.raises(DataError, match=words):
            actuator(one, other)
