"""Checks of studies of motion: what damping and dynamic force need, and what they are compared with."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.spec.check_study import formula_uses
from mapmore_cli.spec.diagnostics import Finding
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.data import STEP_OF
from mapmore_cli.spec.sections.method import CutByDirection
from mapmore_cli.spec.sections.results import Competitor


def needed_runs(spec: ExperimentSpec) -> Iterator[Finding]:
    """Damping is what a static model leaves; a sum has two models."""
    if spec.target == "damping" and spec.needs.static is None:
        yield Finding(("target",), "target `damping` needs a static model", "add `needs: {static: my-static.yaml}`")
    if spec.target == "damping" and spec.data.plateau is None:
        remedy = "add `plateau: auto` to `data`, or `plateau: [2 s, 3 s]`"
        yield Finding(("target",), "target `damping` needs the plateau of each step response", remedy)
    if spec.model.type == "sum" and spec.model.sum is None:
        missing = [name for name in ("static", "damping") if getattr(spec.needs, name) is None]
        if missing:
            remedy = "add `needs: {static: my-static.yaml, damping: my-damping.yaml}`"
            yield Finding(("target",), f"the sum of two models needs {' and '.join(f'`needs.{name}`' for name in missing)}", remedy)


def plateaus(spec: ExperimentSpec) -> Iterator[Finding]:
    """A plateau is found in time and pressure."""
    plateau = spec.data.plateau
    for name in ("time", STEP_OF) if plateau is not None else ():
        if name not in spec.data.quantities:
            yield Finding(("data", "plateau"), f"`plateau` needs the quantity `{name}`", f"add `{name}` to `columns`", on_key=True)
    if isinstance(plateau, tuple) and plateau[0] >= plateau[1]:
        yield Finding(("data", "plateau"), f"the plateau runs from {plateau[0]:g} s to {plateau[1]:g} s", "put the earlier time first")


def directions(spec: ExperimentSpec) -> Iterator[Finding]:
    """The segments of rise and fall go by the quantity `direction`."""
    for name, cut in spec.segment.items():
        if isinstance(cut, CutByDirection) and name != DIRECTION:
            yield Finding(("segment", name), f"`{name}` has no rise and fall", f"call it `{DIRECTION}`", on_key=True)
        if isinstance(cut, CutByDirection) and name in spec.data.quantities:
            remedy = f"derive it or cut by it: remove `{name}` from `data`, or write `{name}: {{method: breakpoints, at: [0]}}` here"
            yield Finding(("segment", name), f"`{name}` is a quantity of the data already", remedy, on_key=True)


def training_level(spec: ExperimentSpec) -> Iterator[Finding]:
    """The one level that trains is one of the levels."""
    chosen, levels = spec.fit.train_level, spec.data.levels
    if chosen == "all":
        return
    if levels is None:
        yield Finding(("fit", "train_level"), "there are no levels to choose from", "add `levels` to `data`", on_key=True)
    elif not isinstance(chosen, str) and not isinstance(levels.at, str) and chosen not in levels.at:
        known = ", ".join(f"{level:g}" for level in levels.at)
        yield Finding(("fit", "train_level"), f"{chosen:g} is no level of `{levels.of}`", f"levels are {known}")


def load_cycle_formulas(spec: ExperimentSpec) -> Iterator[Finding]:
    """A formula that is fitted to load cycles needs those of the static run, and the muscle's length; it is no model of a target."""
    from mapmore_cli.modelling import literature

    for name, loc in formula_uses(spec):
        if name not in literature.names() or literature.get(name).fitted_to != literature.LOAD_CYCLES:
            continue
        if loc[0] == "model":
            yield Finding(loc, f"`{name}` is fitted to load cycles, not to a target", "name it in `validate.against`")
            continue
        if spec.needs.static is None or spec.target not in ("damping", "dynamic"):
            yield Finding(loc, f"`{name}` is fitted to the load cycles of a static run", "add `needs: {static: my-static.yaml}`")
        if spec.muscle.length is None:
            yield Finding(loc, f"`{name}` needs the length of the muscle", "add `length: 88 mm` to `muscle`")


def composites(spec: ExperimentSpec) -> Iterator[Finding]:
    """A static with a damping formula stands against damping and dynamic models, with the static run's data to fit it to."""
    for i, competitor in enumerate(spec.validation.against):
        if not isinstance(competitor, Competitor) or competitor.static is None:
            continue
        loc = ("validate", "against", i)
        if spec.target not in ("damping", "dynamic"):
            yield Finding(loc, f"target `{spec.target}` has no static and damping parts", "give one `model`")
        elif spec.needs.static is None:
            yield Finding(loc, "a static formula is fitted to the data of the static run", "add `needs: {static: my-static.yaml}`")
