"""Wrappers around the C of a model: an actuator of MuJoCo, and a function for Simulink's C Caller."""

from __future__ import annotations

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.c_inverse import c_source
from mapmore_cli.exporting.dialect import identifier, names_of_inputs
from mapmore_cli.modelling.kinds import runs_over_time

MUJOCO = """\
/* {name} as an actuator of MuJoCo: `mjcb_act_bias = {name}_act_bias;` before the simulation.
 *
 * For every actuator with biastype="user" and gaintype="fixed" gainprm="0" on a tendon: ctrl is the pressure [{pressure}], and
 * user="REST STATIONARY" are two lengths in m. strain = (REST - (length - STATIONARY))/REST. The muscle pulls: its force is negative.
 */
#include <mujoco/mujoco.h>

#include "{name}.h"

mjtNum {name}_act_bias(const mjModel* m, const mjData* d, int id)
{{
    const mjtNum* user = m->actuator_user + (long)id * m->nuser_actuator;
    {real} in[{prefix}_INPUTS], force;
    in[{prefix}_IN_PRESSURE] = ({real})d->ctrl[id];
    in[{prefix}_IN_STRAIN] = ({real})((user[0] - (d->actuator_length[id] - user[1])) / user[0]);
    {name}_eval(in, &force);
    return -(mjtNum)force;
}}
"""

SIMULINK_HEADER = """\
/* {name} for Simulink's C Caller: name this header and both sources under Simulation Target, then choose {name}_{output}. */
#ifndef {prefix}_SIMULINK_H
#define {prefix}_SIMULINK_H

double {name}_{output}({parameters});
double {name}_valid({parameters});

#endif
"""

SIMULINK_SOURCE = """\
#include "{name}_simulink.h"

#include "{name}.h"

/* {output_unit}; extrapolated outside of the training range */
double {name}_{output}({parameters})
{{
    double in[{prefix}_INPUTS] = {{{names}}}, out;
    {name}_eval(in, &out);
    return out;
}}

/* 1 within the training range, else 0 */
double {name}_valid({parameters})
{{
    double in[{prefix}_INPUTS] = {{{names}}}, out;
    return {name}_eval(in, &out) == 0;
}}
"""


def mujoco_files(model: Model) -> dict[str, str]:
    """Return the C of a model of pressure and strain, and a callback that MuJoCo asks for the force of an actuator.

    Raises
    ------
    UsageError
        For a model with other inputs, or with memory.
    """
    inputs = {quantity.name: quantity.unit for quantity in model.inputs}
    if runs_over_time(model) or set(inputs) != {"pressure", "strain"} or model.output.name != "force":
        raise UsageError("an actuator of MuJoCo is a force by pressure and strain", "export this model as py, and call it in a callback")
    if (inputs["strain"], model.output.unit) != ("1", "N"):
        raise UsageError("MuJoCo counts in m and N", "run the study with `units: {strain: 1, force: N}`")
    source = c_source(model)
    text = MUJOCO.format(name=source.name, prefix=source.name.upper(), real="double", pressure=inputs["pressure"])
    return {**source.files, f"{source.name}_mujoco.c": text}


def simulink_files(model: Model) -> dict[str, str]:
    """Return the C of a model, and a function of single numbers that a C Caller block calls.

    Raises
    ------
    UsageError
        For a model with memory: a C Caller block keeps no state.
    """
    if runs_over_time(model):
        raise UsageError("a C Caller block keeps no state, and this model has memory", "export it as fmu, which Simulink imports")
    source = c_source(model)
    names = names_of_inputs(model.inputs, [source.name])
    words = {
        "name": source.name,
        "prefix": source.name.upper(),
        "output": identifier(model.output.name),
        "output_unit": f"{model.output.name} [{model.output.unit}]",
        "parameters": ", ".join(f"double {name}" for name in names.values()),
        "names": ", ".join(names.values()),
    }
    own = {f"{source.name}_simulink.h": SIMULINK_HEADER.format(**words), f"{source.name}_simulink.c": SIMULINK_SOURCE.format(**words)}
    return {**source.files, **own}
