"""Wrappers around the C of a model: an actuator of MuJoCo, and a function for Simulink's C Caller."""

from __future__ import annotations

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.c_source import c_source
from mapmore_cli.exporting.dialect import identifier, names_of_inputs, rendered
from mapmore_cli.modelling.kinds import runs_over_time


def mujoco_files(model: Model) -> dict[str, str]:
    """Return the C of a model of pressure and strain, and a callback that MuJoCo asks for the force of an actuator.

    Raises UsageError for a model with other inputs, or with memory.
    """
    inputs = {quantity.name: quantity.unit for quantity in model.inputs}
    if runs_over_time(model) or set(inputs) != {"pressure", "strain"} or model.output.name != "force":
        raise UsageError("an actuator of MuJoCo is a force by pressure and strain", "export this model as py, and call it in a callback")
    if (inputs["strain"], model.output.unit) != ("1", "N"):
        raise UsageError("MuJoCo counts in m and N", "run the study with `units: {strain: 1, force: N}`")
    source = c_source(model)
    text = rendered("mujoco.c", name=source.name, prefix=source.name.upper(), pressure=inputs["pressure"])
    return {**source.files, f"{source.name}_mujoco.c": text}


def simulink_files(model: Model) -> dict[str, str]:
    """Return the C of a model, and a function of single numbers that a C Caller block calls.

    Raises UsageError for a model with memory: a C Caller block keeps no state.
    """
    if runs_over_time(model):
        raise UsageError("a C Caller block keeps no state, and this model has memory", "export it as fmu, which Simulink imports")
    source = c_source(model)
    names = names_of_inputs(model.inputs, [source.name])
    words = {"name": source.name, "prefix": source.name.upper(), "model": model, "output": identifier(model.output.name)}
    words |= {"parameters": ", ".join(f"double {name}" for name in names.values()), "names": ", ".join(names.values())}
    return {**source.files, **{f"{source.name}_simulink.{end}": rendered(f"simulink.{end}", **words) for end in "hc"}}
