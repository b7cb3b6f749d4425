"""Checks of what a kind of model asks of a study: damping and dynamic force, sums, state-space models."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.pieces.recipe import CutByDirection
from mapmore_cli.spec.check_names import NO_TIME, expression_findings
from mapmore_cli.spec.check_study import formula_called, formula_uses
from mapmore_cli.spec.diagnostics import Finding, did_you_mean
from mapmore_cli.spec.experiment import ExperimentSpec, TargetColumn
from mapmore_cli.spec.sections.data import STEP_OF
from mapmore_cli.spec.sections.model import Summand
from mapmore_cli.spec.sections.results import Competitor
from mapmore_cli.spec.tree import Loc
from mapmore_cli.spec.units import default_unit


def needed_runs(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require the runs that a target needs: damping is what a static model leaves; a sum has two models."""
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


def families(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield a family has forces over pressure and strain, and what its specimens differ in."""
    if spec.model.family is None:
        return
    for name in ("pressure", "strain", spec.model.family.of):
        if name not in spec.data.quantities:
            remedy = f"add `{name}` to `columns`, or `set` it beside the files"
            yield Finding(("model", "family"), f"a family needs the quantity `{name}`", remedy, on_key=True)


def plateaus(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield a plateau is found in time and pressure."""
    plateau = spec.data.plateau
    for name in ("time", STEP_OF) if plateau is not None else ():
        if name not in spec.data.quantities:
            yield Finding(("data", "plateau"), f"`plateau` needs the quantity `{name}`", f"add `{name}` to `columns`", on_key=True)
    if isinstance(plateau, tuple) and plateau[0] >= plateau[1]:
        yield Finding(("data", "plateau"), f"the plateau runs from {plateau[0]:g} s to {plateau[1]:g} s", "put the earlier time first")


def directions(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield the segments of rise and fall go by the quantity `direction`."""
    for name, cut in spec.segment.items():
        if isinstance(cut, CutByDirection) and name != DIRECTION:
            yield Finding(("segment", name), f"`{name}` has no rise and fall", f"call it `{DIRECTION}`", on_key=True)
        if isinstance(cut, CutByDirection) and name in spec.data.quantities:
            remedy = f"derive it or cut by it: remove `{name}` from `data`, or write `{name}: {{method: breakpoints, at: [0]}}` here"
            yield Finding(("segment", name), f"`{name}` is a quantity of the data already", remedy, on_key=True)


def training_level(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield the one level that trains is one of the levels."""
    chosen, levels = spec.fit.train_level, spec.data.levels
    if chosen == "all":
        return
    if levels is None:
        yield Finding(("fit", "train_level"), "there are no levels to choose from", "add `levels` to `data`", on_key=True)
    elif not isinstance(chosen, str) and not isinstance(levels.at, str) and chosen not in levels.at:
        known = ", ".join(f"{level:g}" for level in levels.at)
        yield Finding(("fit", "train_level"), f"{chosen:g} is no level of `{levels.of}`", f"levels are {known}")


def load_cycle_formulas(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield a formula that is fitted to load cycles needs those of the static run, and the muscle's length; it is no model of a target."""
    for name, loc in formula_uses(spec):
        formula = formula_called(spec, name)
        if formula is None or formula.fitted_to != literature.LOAD_CYCLES:
            continue
        if loc[0] == "model":
            yield Finding(loc, f"`{name}` is fitted to load cycles, not to a target", "name it in `validate.against`")
            continue
        if spec.needs.static is None or spec.target not in ("damping", "dynamic"):
            yield Finding(loc, f"`{name}` is fitted to the load cycles of a static run", "add `needs: {static: my-static.yaml}`")
        if spec.muscle.length is None:
            yield Finding(loc, f"`{name}` needs the length of the muscle", "add `length: 88 mm` to `muscle`")


def composites(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield a static with a damping formula stands against damping and dynamic models, with the static run's data to fit it to."""
    for i, competitor in enumerate(spec.validation.against):
        if not isinstance(competitor, Competitor) or competitor.static is None:
            continue
        loc = ("validate", "against", i)
        if spec.target not in ("damping", "dynamic"):
            yield Finding(loc, f"target `{spec.target}` has no static and damping parts", "give one `model`")
        elif spec.needs.static is None:
            yield Finding(loc, "a static formula is fitted to the data of the static run", "add `needs: {static: my-static.yaml}`")


def sums(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check every sum of a study: its own, and those that it is compared with."""
    if spec.model.sum is not None:
        yield from _sum(spec, spec.model.sum, ("model", "sum"))
    for i, competitor in enumerate(spec.validation.against):
        if isinstance(competitor, Competitor) and competitor.sum is not None:
            yield from _sum(spec, competitor.sum, ("validate", "against", i, "sum"))


def _sum(spec: ExperimentSpec, parts: Sequence[Summand], loc: Loc) -> Iterator[Finding]:
    from mapmore_cli.modelling.sums.joint import refuse_shared_names

    known = []
    for i, part in enumerate(parts):
        for name, text in part.inputs.items():
            yield from expression_findings(text, (*loc, i, "inputs", name), spec.quantities)
        if part.formula is None:
            continue
        formula = formula_called(spec, part.formula)
        if formula is None:
            if part.formula not in spec.own_formulas:
                remedy = did_you_mean(part.formula, (*literature.names(), *spec.own_formulas))
                yield Finding((*loc, i, "formula"), f"there is no literature model `{part.formula}`", remedy)
            continue
        inputs = formula.inputs
        known.append((f"{part.formula} ({i + 1})", inputs, part.inputs))
        for name in part.inputs:
            if name not in inputs:
                yield Finding((*loc, i, "inputs", name), f"`{part.formula}` has no input `{name}`", did_you_mean(name, inputs), on_key=True)
        for name in inputs:
            if name not in part.inputs and name not in spec.quantities:
                remedy = f"say what it is here, as `inputs: {{{name}: my_{name}}}`"
                yield Finding((*loc, i, "formula"), f"`{part.formula}` needs the quantity `{name}`", remedy)
    try:
        refuse_shared_names(known)
    except SpecError as error:
        yield Finding(loc, error.message, error.remedy)


NAME = "a state-space model"


def time(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require the time, in seconds, along whole recordings."""
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
    """Yield what drives it is measured, and is not the target, which is a column."""
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
        what = "a dead band goes with `direction: true` and `switching: bumpless`; other switching goes by every change of the input"
        yield Finding(("model", "dead_band"), what, "remove it", on_key=True)
    for key in ("bounds", "begin"):
        if getattr(model, key) is not None and model.solver != "swarm":
            yield Finding(("model", key), f"`solver: {model.solver}` looks at all stable sections", f"remove `{key}`", on_key=True)
    if model.mask != "input" and not model.direction:
        yield Finding(
            ("model", "mask"), "`mask` tells rise from fall, and sections have no direction", "add `direction: true`", on_key=True
        )
    if model.polish and model.solver == "least_squares":
        yield Finding(("model", "polish"), "`polish` goes on by least squares, which this solver is", "remove it", on_key=True)
    if model.solver == "swarm" and (model.offset or model.load is not None or model.switching == "bumpless"):
        what = "`solver: swarm` looks for P1, P2 and P3 alone, which an offset, a load or bumpless switching are not"
        yield Finding(("model", "solver"), what, "use `swarm_projected`, `differential_evolution` or `least_squares`")
