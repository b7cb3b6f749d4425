"""FMUs: valid by FMPy, equal to `predict` when it simulates them, the same bytes again, and clear
where something is refused.
"""

import io
import shutil
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from agreement import FLAGS, points, recording
from export_samples import FORMULAS, STATIC, WITH_MEMORY, pieces
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from replay import simulated

from mapmore_cli.annexes.exporting.exports import exported
from mapmore_cli.annexes.exporting.fmu import fmu_sources
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.programs import program_of

needs_compiler = pytest.mark.skipif(
    shutil.which("cc") is None, reason="there is no C compiler here"
)

COMMON = """
        GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment
    EnterInitializationMode ExitInitializationMode
        Terminate Reset GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean
    SetString GetFMUstate SetFMUstate FreeFMUstate
    SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative
"""
CO_SIMULATION = """
        SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus
    GetRealStatus GetIntegerStatus GetBooleanStatus
    GetStringStatus
"""
SYMBOLS = [f"fmi2{name}" for name in (COMMON + CO_SIMULATION).split()]
"""The functions of FMI 2.0.4, sections 2.1 and 4.2."""


def unit_of(model, folder, to="fmu"):
    """The unit of a model as a file."""
    ((name, data),) = exported(model, to).items()
    (folder / name).write_bytes(data)
    return folder / name


def greatest_difference(found, expected):
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    return float(np.nanmax(np.abs(found - expected)) / np.nanmedian(np.abs(expected)))


def checked(model, folder, columns, to="fmu"):
    """What FMPy gets from the valid unit of a model along columns; the values are those of
    `predict`.
    """
    file = unit_of(model, folder, to)
    assert validate_fmu(str(file)) == []
    found = simulated(model, file, columns, program_of(model).step or 0.1)[1:]
    assert greatest_difference(found[model.output.name], predict(model, columns)) < 1e-9
    return found


@needs_compiler
@pytest.mark.parametrize("to", ["fmu", "fmu3"])
def test_a_static_unit_is_predict(tmp_path, to):
    model = STATIC["two levels"]
    assert set(checked(model, tmp_path, points(model, 400), to)["outside_range"]) >= {0, 1, 2}


@needs_compiler
@pytest.mark.parametrize(
    ("name", "to"),
    [
        *((name, "fmu") for name in ("a sum", "hysteresis of the output", "motion, handed on")),
        *(("fed back", to) for to in ("fmu", "fmu3")),
    ],
)
def test_a_unit_with_memory_is_predict_along_a_recording(tmp_path, name, to):
    model = replace(WITH_MEMORY[name], name=f"memory {name}")
    assert program_of(model).step is not None
    checked(model, tmp_path, recording(model, 600), to)


@needs_compiler
def test_a_unit_of_fmi_3_keeps_states_and_says_what_it_refuses(tmp_path):
    model = WITH_MEMORY["operators"]
    folder = fmpy.extract(str(unit_of(model, tmp_path, "fmu3")), str(tmp_path / "unpacked"))
    described = fmpy.read_model_description(folder)
    unit = FMU3Slave(
        guid=described.instantiationToken,
        unzipDirectory=folder,
        modelIdentifier=described.coSimulation.modelIdentifier,
        instanceName="one",
    )
    unit.instantiate()
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    unit.setFloat64([0, 1], [300.0, 0.1])
    unit.doStep(0.0, 0.2)
    state = unit.getFMUState()
    written = unit.serializeFMUState(state)
    unit.setFloat64([0, 1], [100.0, 0.05])
    unit.doStep(0.2, 0.01)
    (first,) = unit.getFloat64([2])
    unit.setFMUState(unit.deserializeFMUState(written))
    unit.setFloat64([0, 1], [100.0, 0.05])
    unit.doStep(0.2, 0.01)
    assert unit.getFloat64([2, 4]) == [first, 0.2 + 0.01], "the output again, and the time"
    refused = [
        lambda: unit.doStep(0.02, 0.015),
        lambda: unit.setFloat64([2], [1.0]),
        lambda: unit.getInt32([0]),
        lambda: unit.getBoolean([0]),
    ]
    for call in refused:
        with pytest.raises(FMICallException):
            call()
    unit.terminate()
    unit.freeInstance()


def test_units_of_every_kind_are_valid_without_a_compiler(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    for model in [
        STATIC["no levels"],
        STATIC["a difference"],
        *WITH_MEMORY.values(),
        FORMULAS["reynolds"],
    ]:
        warnings = []
        ((name, data),) = exported(model, "fmu", warn=warnings.append).items()
        (tmp_path / name).write_bytes(data)
        assert validate_fmu(str(tmp_path / name)) == []
        assert len(warnings) == 1
        assert "no-such-compiler" in warnings[0]
        assert "only source code" in warnings[0]
        assert not [
            one
            for one in zipfile.ZipFile(io.BytesIO(data)).namelist()
            if one.startswith("binaries/")
        ]


def test_a_compiler_that_fails_is_told(monkeypatch):
    monkeypatch.setenv("CC", "false")
    warnings = []
    exported(pieces(), "fmu", warn=warnings.append)
    assert "false failed" in warnings[0]


@needs_compiler
def test_the_same_model_gives_the_same_bytes_and_another_one_another_guid():
    ((_, one),) = exported(FORMULAS["reynolds"], "fmu").items()
    ((_, again),) = exported(FORMULAS["reynolds"], "fmu").items()
    assert one == again
    assert {entry.date_time for entry in zipfile.ZipFile(io.BytesIO(one)).infolist()} == {
        (1980, 1, 1, 0, 0, 0)
    }
    guids = {
        fmu_sources(model, "tool").description.split('guid="')[1][:36]
        for model in (pieces(), pieces(z_s=0.1))
    }
    assert len(guids) == 2


def test_units_of_measurement_are_declared_by_base_units(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    model = replace(pieces(), output=Quantity("force", "spam"))
    described = fmpy.read_model_description(str(unit_of(model, tmp_path)))
    found = {unit.name: unit.baseUnit for unit in described.unitDefinitions}
    assert list(found) == ["kPa", "1", "spam"]
    assert (found["kPa"].kg, found["kPa"].m, found["kPa"].s, found["kPa"].factor) == (
        1,
        -1,
        -2,
        1000.0,
    )
    assert found["spam"] is None, "nobody knows it"
    variables = {one.name: one for one in described.modelVariables}
    assert {name: one.unit for name, one in variables.items()} == {
        "pressure": "kPa",
        "strain": "1",
        "force": "spam",
        "outside_range": None,
    }
    assert variables["pressure"].start == "100.0", "the lowest level: zero was not trained"


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("unit")
    return Path(
        fmpy.extract(str(unit_of(WITH_MEMORY["operators"], folder)), str(folder / "unpacked"))
    )


@pytest.fixture
def slave(unpacked):
    """A unit with memory, initialized; `said` is what it logs."""
    described = fmpy.read_model_description(str(unpacked))
    name = described.coSimulation.modelIdentifier
    unit = FMU2Slave(
        guid=described.guid, unzipDirectory=str(unpacked), modelIdentifier=name, instanceName="one"
    )
    unit.said = said = []
    calls = fmpy.fmi2.defaultCallbacks
    logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(lambda *about: said.append(about[-1].decode()))
    unit.instantiate(callbacks=type(calls)(logger, calls.allocateMemory, calls.freeMemory))
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    yield unit
    unit.freeInstance()


@needs_compiler
def test_every_function_of_the_standard_is_there(slave):
    assert len(SYMBOLS) == 34
    for name in SYMBOLS:
        assert getattr(slave.dll, name), name


@needs_compiler
def test_a_state_can_be_kept_written_and_gone_back_to(slave):
    columns = recording(WITH_MEMORY["operators"], 60)
    rows = np.stack([columns["pressure"], columns["strain"]], axis=1)

    def run(start, end):
        found = []
        for row in range(start, end):
            slave.setReal([0, 1], rows[row].tolist())
            slave.doStep(row * 0.01, 0.01)
            found += slave.getReal([2])
        return found

    run(0, 20)
    state = slave.getFMUstate()
    written = slave.serializeFMUstate(state)
    first = run(20, 40)
    slave.setFMUstate(state)
    assert run(20, 40) == first
    slave.freeFMUstate(state)
    slave.setFMUstate(slave.deSerializeFMUstate(written))
    assert run(20, 40) == first
    slave.reset()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    assert run(0, 40)[20:] == first


@needs_compiler
def test_several_samples_within_a_step_hold_their_inputs(slave):
    slave.setReal([0, 1], [300.0, 0.1])
    at_rest = slave.getReal([2])
    slave.doStep(0.0, 0.05)
    model = WITH_MEMORY["operators"]
    held = {"time": np.arange(5) * 0.01, "pressure": np.full(5, 300.0), "strain": np.full(5, 0.1)}
    expected = predict(model, held)
    assert slave.getReal([2]) == pytest.approx([expected[-1]], rel=1e-9, nan_ok=True)
    assert at_rest == pytest.approx([expected[0]], rel=1e-9, nan_ok=True)


@needs_compiler
def test_what_is_refused_says_why(slave):
    calls = {
        "the time between the model's samples": lambda: slave.doStep(0.0, 0.015),
        "must be longer than zero": lambda: slave.doStep(0.0, 0.0),
        "canInterpolateInputs": lambda: slave.setRealInputDerivatives([0], [1], [1.0]),
        "maxOutputDerivativeOrder": lambda: slave.getRealOutputDerivatives([2], [1]),
        "only inputs can be set": lambda: slave.setReal([2], [1.0]),
        "no such real": lambda: slave.getReal([17]),
        "no such integer": lambda: slave.getInteger([0]),
        "no step is under way": slave.cancelStep,
        "initialized already": slave.enterInitializationMode,
        "not provided": lambda: slave.getDirectionalDerivative([2], [0], [1.0]),
    }
    for reason, call in calls.items():
        with pytest.raises(FMICallException) as refused:
            call()
        assert refused.value.status == fmpy.fmi2.fmi2Error
        assert reason in slave.said[-1]
    assert len(slave.said) == len(calls)
    slave.doStep(0.0, 0.01)


DRIVER = """
#include "co-simulation.h"
#include "this-model.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static int told;

static void logger(fmi2ComponentEnvironment e, fmi2String instance, fmi2Status status,
    fmi2String category, fmi2String message, ...)
{
    (void)e; (void)instance; (void)category;
    if (status == fmi2Error && strlen(message) > 10 && !strchr(message, '%')) told++;
}

int main(void)
{
    const fmi2CallbackFunctions calls = {logger, calloc, free, NULL, NULL};
    const fmi2ValueReference out[] = {INPUTS + MEASURED}, bits[] = {INPUTS + MEASURED + 1},
        wrong[] = {99};
    fmi2Component one, two;
    fmi2FMUstate state = NULL, other = NULL;
    fmi2Byte bytes[100000];
    size_t size;
    double y, z;
    int b;
    if (fmi2Instantiate("x", fmi2CoSimulation, "another", "", &calls, 0, 0)) return 1;
    if (fmi2Instantiate("x", fmi2ModelExchange, MODEL_GUID, "", &calls, 0, 0)) return 2;
    one = fmi2Instantiate("a rather long name of an instance", fmi2CoSimulation, MODEL_GUID, "",
        &calls, 0, 1);
    two = fmi2Instantiate("", fmi2CoSimulation, MODEL_GUID, "", &calls, 0, 0);
    if (!one || !two || told != 2) return 3;
    if (fmi2DoStep(one, 0, 1, 1) != fmi2Error) return 4;
    fmi2SetupExperiment(one, 0, 0, 5, 0, 0);
    if (fmi2ExitInitializationMode(one) != fmi2Error || fmi2EnterInitializationMode(one) ||
        fmi2ExitInitializationMode(one)) return 5;
    fmi2GetReal(one, out, 1, &y);
    for (int i = 0; i < 50; i++) {
        const fmi2ValueReference in[] = {0};
        const double p[] = {i == 30 ? NAN : 20.0 * i};
        if (fmi2SetReal(one, in, 1, p)) return 6;
        if (i == 20 && fmi2GetFMUstate(one, &state)) return 7;
        if (fmi2DoStep(one, 0.01 * i, 0.01, 1)) return 8;
        if (i == 20) fmi2GetReal(one, out, 1, &y);
        if (fmi2GetInteger(one, bits, 1, &b) || (i == 30 && !(b & 1))) return 9;
    }
    fmi2SerializedFMUstateSize(one, state, &size);
    if (size > sizeof bytes || fmi2SerializeFMUstate(one, state, bytes, size)) return 10;
    if (fmi2DeSerializeFMUstate(two, bytes, size, &other)) return 10;
    fmi2SetFMUstate(two, other);
    if (fmi2DoStep(two, 0.2, 0.01, 1) || fmi2GetReal(two, out, 1, &z) || y != z) return 11;
    if (fmi2GetReal(one, wrong, 1, &y) != fmi2Error || fmi2SetReal(one, out, 1,
        &y) != fmi2Error) return 12;
    fmi2GetRealStatus(one, fmi2LastSuccessfulTime, &y);
    if (y != 0.01 * 49 + 0.01 || fmi2Terminate(one) || fmi2DoStep(one, 1, 1, 1) != fmi2Error ||
        fmi2Reset(one)) return 13;
    fmi2FreeFMUstate(one, &state);
    fmi2FreeFMUstate(two, &other);
    fmi2FreeInstance(one);
    fmi2FreeInstance(two);
    fmi2FreeInstance(NULL);
    return 0;
}
"""


@needs_compiler
@pytest.mark.parametrize(
    "model",
    [STATIC["one level"], WITH_MEMORY["operators"], WITH_MEMORY["fed back"]],
    ids=["static", "memory", "fed back"],
)
def test_the_sources_are_clean_by_warnings_and_sanitizers(tmp_path, model):
    unit = fmu_sources(model, "tool")
    for name, text in unit.sources.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "driver.c").write_text(DRIVER)
    sanitize = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    subprocess.run(["gcc", *FLAGS, *sanitize, *unit.compiled, "-c"], cwd=tmp_path, check=True)
    objects = [name.replace(".c", ".o") for name in unit.compiled]
    lenient = ["-std=c99", "-Wno-unused-function", *sanitize]
    subprocess.run(
        ["gcc", *lenient, "driver.c", *objects, "-o", "driver", "-lm"], cwd=tmp_path, check=True
    )
    subprocess.run([str(tmp_path / "driver")], cwd=tmp_path, check=True, timeout=60)
