"""Check the spec of a model of motion."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import cast

from mapmore_cli.annexes.motion.problem import MotionSettings
from mapmore_cli.study.checks.remedies import unknown_quantity
from mapmore_cli.study.diagnostics import Finding
from mapmore_cli.study.experiment import ExperimentSpec, TargetColumn


def findings(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check a state-space model: the quantities that drive it are measured and are not its target,
    and every setting has an effect.
    """
    if spec.model.type == "state_space":
        model = cast(MotionSettings, spec.model)
        yield from _of_quantities(spec, model)
        yield from _of_settings(model)


def _of_quantities(spec: ExperimentSpec, model: MotionSettings) -> Iterator[Finding]:
    """Check the input, the target and the load."""
    if model.input is None:
        yield Finding(
            "model.type",
            "type `state_space` needs the `input`",
            "add it, for example `input: pressure`",
        )
    if not isinstance(spec.target, TargetColumn):
        problem = (
            f"a state-space model predicts a measured quantity, not the component `{spec.target}`"
        )
        yield Finding("target", problem, "write `target: {column: displacement}`")
    for key, name in (("input", model.input), ("load", model.load)):
        if name is not None:
            yield from unknown_quantity(name, spec.data.quantities, ("model", key))
            if name == spec.target_quantity:
                yield Finding(
                    f"model.{key}",
                    f"`{name}` is the target itself",
                    "name the quantity that drives it, for example a pressure or a voltage",
                )


def _of_settings(model: MotionSettings) -> Iterator[Finding]:
    """Check the boundaries between sections, the settings for the direction of the input, and those
    of the solver.
    """
    if not isinstance(model.sections, int) and any(
        after <= before for before, after in pairwise(model.sections)
    ):
        remedy = f"write `sections: {sorted(set(model.sections))}`"
        yield Finding(
            "model.sections", "the boundaries between the sections do not increase", remedy
        )
    if model.dead_band > 0 and not (model.direction and model.switching == "bumpless"):
        problem = (
            "a dead band needs `direction: true` and `switching: bumpless`; with other "
            "settings every change of the input counts"
        )
        yield Finding("model.dead_band:", problem, "remove it")
    if model.mask != "input" and not model.direction:
        yield Finding(
            "model.mask:",
            "`mask` names the quantity whose direction divides rise from fall, but without "
            "`direction: true` the sections do not distinguish the two",
            "add `direction: true`",
        )
    for key in ("begin", "seed") if model.solver != "swarm" else ():
        if getattr(model, key) != getattr(MotionSettings, key):
            problem = f"`solver: {model.solver}` has no particles, so that `{key}` has no effect"
            yield Finding(f"model.{key}:", problem, f"remove `{key}`, or write `solver: swarm`")
    if model.solver == "swarm" and (
        model.offset or model.load is not None or model.switching == "bumpless"
    ):
        problem = (
            "`solver: swarm` finds P1, P2 and P3 only; it cannot find an offset, a load or "
            "bumpless switching"
        )
        yield Finding("model.solver", problem, "use `least_squares`")
