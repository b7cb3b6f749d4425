"""Step responses: their plateau, the pressure on it, and the damping force that a static model leaves (M2 section 3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from mapmore_cli.domain.arrays import BoolArray
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import DAMPING, STATIC_FORCE, Quantity, Recording
from mapmore_cli.ingestion.samples import located
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.modelling.signals.plateau import find_plateau, without_steady_state
from mapmore_cli.spec.sections.data import STEP_OF, STEP_PRESSURE
from mapmore_cli.spec.units import convert
from mapmore_cli.storage.run_folder import RunFiles

PLATEAU = "plateau"
"""1 on the plateau of a step response, else 0."""

MOSTLY = 0.9
"""Share of a plateau that must be out of range for a warning: noise takes half of a plateau at the highest level beyond it."""

Plateau = Literal["auto"] | tuple[float, float]


def with_plateau(recording: Recording, plateau: Plateau, units: Mapping[str, str]) -> Recording:
    """Return the recording with `plateau` and `step_pressure`, the mean pressure there.

    Raises DataError where there is no plateau, or no sample in the one that is given.
    """
    columns = recording.columns
    seconds = convert(columns["time"], units["time"], "s")
    if plateau == "auto":
        others = {name: columns[name] for name in ("strain", "displacement") if name in columns}
        with located(recording.source):
            start, end = find_plateau(seconds, columns[STEP_OF], others)
    else:
        start, end = plateau
    on: BoolArray = (seconds >= start) & (seconds <= end)
    if not on.any():
        raise DataError(
            f"{recording.source}: no sample from {start:g} s to {end:g} s, where the spec puts the plateau; the recording runs from "
            f"{seconds[0]:g} s to {seconds[-1]:g} s",
            "give another `plateau`, or write `plateau: auto`",
        )
    step = np.full(len(on), columns[STEP_OF][on].mean())
    return replace(recording, columns={**columns, PLATEAU: on.astype(float), STEP_PRESSURE: step})


def static_model(run_dir: Path, force: Quantity, units: Mapping[str, str]) -> Model:
    """Return the static model that a spec needs.

    Raises SpecError where it is of another quantity or unit, or has an input that the recordings lack or hold in another unit.
    """
    model = RunFiles(run_dir).model()
    if model.output != force:
        found = f"{model.output.name} in {model.output.unit}"
        raise SpecError(f"needs.static: the model of {model.name} is of {found}, not of {force.name} in {force.unit}", "need another run")
    for quantity in model.inputs:
        if units.get(quantity.name) != quantity.unit:
            have = f"in {units[quantity.name]}" if quantity.name in units else "not at all"
            raise SpecError(
                f"needs.static: the model of {model.name} is a function of {quantity.name} in {quantity.unit}; this study has it {have}",
                f"declare the column, or set `units: {{{quantity.name}: {quantity.unit}}}`",
            )
    return model


def with_damping(recording: Recording, force: str, static: Model, warn: Callable[[str], None]) -> Recording:
    """Return the recording with `static_force` F_s and `damping` `F_d = F - F_s`, less its mean over the plateau (M2 eq 1)."""
    columns = recording.columns
    static_force = predict(static, columns)
    beyond = outside_range(static, columns)
    on = columns[PLATEAU] == 1.0
    if beyond[on].mean() > MOSTLY:
        warn(f"{recording.source}: the plateau is outside the range that the static model {static.name} was trained on")
    damping = without_steady_state(columns[force] - static_force, on)
    return replace(recording, columns={**columns, STATIC_FORCE: static_force, DAMPING: damping})
