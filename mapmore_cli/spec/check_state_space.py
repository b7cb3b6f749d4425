"""Checks of what a state-space model asks of a study."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from mapmore_cli.spec.check_names import NO_TIME
from mapmore_cli.spec.diagnostics import Finding, did_you_mean
from mapmore_cli.spec.experiment import ExperimentSpec, TargetColumn
from mapmore_cli.spec.units import default_unit

NAME = "a state-space model"


def time(spec: ExperimentSpec) -> Iterator[Finding]:
    """It goes by the time, in seconds, along whole recordings."""
    if spec.model.type != "state_space":
        return
    data = spec.data
    if "time" not in data.quantities:
        yield Finding(("model", "type"), f"{NAME} needs the time", NO_TIME)
    elif default_unit("time", spec.units) != "s":
        yield Finding(("units", "time"), f"{NAME} goes by the time in s", "remove it: columns are converted", on_key=True)
    if data.cycles is not None:
        what = f"`cycles` puts samples in the order of `{data.cycles.over}`, and {NAME} goes by the time"
        yield Finding(("data", "cycles"), what, "remove `cycles`", on_key=True)
    if data.split.hold_out is not None and data.split.hold_out.fraction is not None:
        remedy = "hold out the end of every recording, as `last: 0.25`, or whole `recordings`"
        what = f"samples drawn at random are held out from between those that train, and {NAME} runs along all of them"
        yield Finding(("data", "split", "validate", "fraction"), what, remedy, on_key=True)


def quantities(spec: ExperimentSpec) -> Iterator[Finding]:
    """What drives it is measured, and is not the target, which is a column."""
    if spec.model.type != "state_space":
        return
    if not isinstance(spec.target, TargetColumn):
        remedy = "write `target: {column: displacement}`"
        yield Finding(("target",), f"{NAME} predicts a measured quantity, not the component `{spec.target}`", remedy)
    for key in ("input", "load"):
        name = getattr(spec.model, key)
        if name is None:
            continue
        if name not in spec.data.quantities:
            yield Finding(("model", key), f"there is no quantity `{name}` in this study", did_you_mean(name, spec.data.quantities))
        elif name == spec.target_quantity:
            yield Finding(("model", key), f"`{name}` is the target", "name the quantity that drives it, as a pressure or a voltage")


def sections(spec: ExperimentSpec) -> Iterator[Finding]:
    """Boundaries increase, and settings have something to act on."""
    model = spec.model
    if model.type != "state_space":
        return
    if not isinstance(model.sections, int) and any(after <= before for before, after in pairwise(model.sections)):
        remedy = f"write `sections: {sorted(set(model.sections))}`"
        yield Finding(("model", "sections"), "the boundaries between the sections do not increase", remedy)
    if model.dead_band > 0 and not (model.direction and model.switching == "bumpless"):
        what = "a dead band goes with `direction: true` and `switching: bumpless`; hard switching goes by every change of the input"
        yield Finding(("model", "dead_band"), what, "remove it", on_key=True)
    if model.bounds is not None and model.solver != "swarm":
        yield Finding(("model", "bounds"), f"`solver: {model.solver}` looks at all stable sections", "remove `bounds`", on_key=True)
    if model.polish and model.solver == "least_squares":
        yield Finding(("model", "polish"), "`polish` goes on by least squares, which this solver is", "remove it", on_key=True)
    if model.solver == "swarm" and (model.offset or model.load is not None or model.switching == "bumpless"):
        what = "`solver: swarm` looks for P1, P2 and P3 alone, which an offset, a load or bumpless switching are not"
        yield Finding(("model", "solver"), what, "use `swarm_projected`, `differential_evolution` or `least_squares`")
