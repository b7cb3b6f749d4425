"""Checks that the choices of an experiment fit each other: levels, hold-out, target, formulas, metrics, units."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.scores import BASELINES, METRICS, OWN, REPEATABILITY, SIMPLE
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import ExpressionError
from mapmore_cli.modelling.literature.formula import can_be_solved
from mapmore_cli.modelling.literature.own import formula_of
from mapmore_cli.modelling.pieces.recipe import Cuts, Fuse
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.spec.diagnostics import Finding, did_you_mean
from mapmore_cli.spec.experiment import ExperimentSpec, TargetColumn
from mapmore_cli.spec.sections.dictionary import entries_of, texts_in
from mapmore_cli.spec.sections.logs import Logs
from mapmore_cli.spec.sections.model import OwnFormula
from mapmore_cli.spec.sections.results import Competitor
from mapmore_cli.spec.tree import Loc
from mapmore_cli.spec.units import CANONICAL, check_unit, convert, default_unit, is_canonical

if TYPE_CHECKING:
    from mapmore_cli.modelling.literature import LiteratureModel

LEFT_OUT = ("data", "split", "leave_one_level_out")
LEFT_OUT_GROUP = ("data", "split", "leave_one_group_out")


def levels(spec: ExperimentSpec) -> Iterator[Finding]:
    """Only the level quantity is segmented by its levels, and by nothing else."""
    level = spec.data.levels.of if spec.data.levels else None
    for name, cut in spec.segment.items():
        if cut == "levels" and name != level:
            yield Finding(
                ("segment", name), f"`{name}` has no levels", f"add `levels: {{of: {name}}}` to `data`, or cut it by `method: even`"
            )
        if isinstance(cut, Cuts) and name == level:
            remedy = f"remove it: `levels` segments `{name}` already; or write `{name}: none` to pool all levels"
            yield Finding(("segment", name), f"`{name}` is constant within a curve and cannot be cut", remedy, on_key=True)
    if spec.data.split.leave_one_level_out and level is None:
        yield Finding(LEFT_OUT, "there are no levels to leave out", "add `levels` to `data`", on_key=True)
    elif spec.data.split.leave_one_level_out and (spec.has_memory or spec.model.type == "sum"):
        remedy = "hold out recordings, as `validate: {last: 0.5}`"
        yield Finding(LEFT_OUT, "neither a model with memory nor a sum can be fitted without one of the levels", remedy, on_key=True)


def groups(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield groups are told apart by a quantity of the data, and can be left out of models that are made in one go."""
    of, split = spec.data.groups, spec.data.split
    if of is not None and of.of not in spec.data.quantities:
        remedy = f"add it to `columns`, or `set: {{{of.of}: 1}}` beside the files"
        yield Finding(("data", "groups", "of"), f"no recording has the quantity `{of.of}`", remedy)
    if of is not None and of.offset:
        yield from _offsets(spec)
    if split.leave_one_group_out and of is None:
        yield Finding(LEFT_OUT_GROUP, "there are no groups to leave out", "add `groups: {of: specimen}` to `data`", on_key=True)
    elif split.leave_one_group_out and (spec.has_memory or spec.model.type == "sum"):
        remedy = "hold one out, as `validate: {specimen: [2]}`"
        yield Finding(LEFT_OUT_GROUP, "neither a model with memory nor a sum can be fitted without one of the groups", remedy, on_key=True)


def _offsets(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield why offsets of groups cannot be taken off: of groups that are left out, or of a difference."""
    where = ("data", "groups", "offset")
    if spec.data.split.leave_one_group_out:
        yield Finding(where, "the offset of a group that is left out is not known", "remove `offset` or `leave_one_group_out`", on_key=True)
    if spec.target in ("hysteresis", "damping"):
        yield Finding(where, f"the {spec.target} force is a difference, which no offset changes", "remove `offset`", on_key=True)


def after_cycles(spec: ExperimentSpec) -> Iterator[Finding]:
    """Refuse what goes by the time of joined branches: their samples stand in the order of `cycles.over`."""
    cycles, hold_out = spec.data.cycles, spec.data.split.hold_out
    if cycles is None:
        return
    uses: list[Loc] = [("segment", "time")] if "time" in spec.segment else []
    uses += [("data", "split", "validate", "time")] if hold_out is not None and "time" in hold_out.quantities else []
    for loc, _, family in entries_of(spec.dictionary):
        uses += [at for at, text, _ in texts_in(loc, family) if re.search(r"\btime\b", text)]
    for loc in uses:
        what = f"`cycles` puts samples in the order of `{cycles.over}`: they have no `time` any more"
        yield Finding(loc, what, f"name `{cycles.over}` or another quantity, or remove `cycles`", on_key=loc[-1] == "time")


def boundaries_by_fits(spec: ExperimentSpec) -> Iterator[Finding]:
    """Boundaries that fits decide need fits of terms."""
    for name, cut in spec.segment.items():
        if isinstance(cut, Cuts) and cut.method == "optimal" and not (spec.model.type == "mapmore" and spec.dictionary):
            what = f"`optimal` places boundaries by fits of terms, and model `{spec.model.type}` has none"
            yield Finding(("segment", name), what, "use another `method`, or remove it", on_key=True)


def joining(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield what is set about the way between levels, or about a residual, has something to act on."""
    defaults = Fuse()
    pooled = spec.data.levels is None or spec.segment.get(spec.data.levels.of) == "none"
    for key in ("levels", "align"):
        if pooled and getattr(spec.fuse, key) != getattr(defaults, key):
            yield Finding(
                ("fuse", key), "there are no levels to interpolate between", f"remove `{key}`, or add `levels` to `data`", on_key=True
            )
    if spec.model.backbone is None and spec.fuse.shrink != defaults.shrink:
        yield Finding(("fuse", "shrink"), "there is no residual to carry", "remove it, or give the `model` a `backbone`", on_key=True)


def held_out(spec: ExperimentSpec) -> Iterator[Finding]:
    """Held-out values of the level quantity must be levels."""
    levels, hold_out = spec.data.levels, spec.data.split.hold_out
    if levels is None or isinstance(levels.at, str) or hold_out is None:
        return
    values = hold_out.quantities.get(levels.of)
    reach = levels.within or (levels.spacing or 0) / 2
    for i, value in enumerate(values if isinstance(values, list) else ()):
        if min(abs(value - level) for level in levels.at) > reach:
            known = ", ".join(f"{level:g}" for level in levels.at)
            yield Finding(("data", "split", "validate", levels.of, i), f"{value:g} is no level of `{levels.of}`", f"levels are {known}")


def target(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield what is modelled must be measured, and must not explain itself."""
    target = spec.target_quantity
    if not isinstance(spec.target, TargetColumn) and target not in spec.data.quantities:
        yield Finding(("target",), f"target `{spec.target}` needs the quantity `{target}`", f"add `{target}` to `columns`")
    if spec.target == "hysteresis" and spec.data.cycles is None:
        yield Finding(("target",), "target `hysteresis` needs load cycles", "add `cycles: {over: strain}` to `data`")
    remedy = "a model cannot explain its target by itself: take it out"
    for name in spec.segment:
        if name == target:
            yield Finding(("segment", name), f"`{name}` is the target", remedy, on_key=True)


def chosen_backbone(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield a backbone is chosen by levels or blocks that are left out, for segments that do not depend on it."""
    if spec.model.backbone != AUTO:
        return
    loc, remedy = ("model", "backbone"), "name a formula, as `sarosi`"
    if spec.has_memory:
        yield Finding(loc, "`auto` chooses by left-out levels or blocks, and a model with memory has none", remedy)
    elif any(isinstance(cut, Cuts) and cut.method == "optimal" for cut in spec.segment.values()):
        yield Finding(loc, "`auto` chooses for given segments, and `optimal` ones depend on the backbone", f"{remedy}, or cut `even`")


def turned(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield a model is inverted to be scored as one of its inputs: it has no memory, and the input is not its target."""
    name, loc = spec.validation.as_, ("validate", "as")
    if name is None:
        return
    if not isinstance(spec.target, TargetColumn) or name == spec.target.column:
        yield Finding(loc, f"`{name}` needs a model of another quantity to be inverted", "set `target: {column: strain}`, or remove `as`")
    elif spec.has_memory or spec.model.type != "mapmore":
        yield Finding(loc, "only a model of pieces can be inverted to be scored", "remove `as`")


def formulas(spec: ExperimentSpec) -> Iterator[Finding]:
    """Literature models exist, find their inputs in the study, and each has its own name in the scores."""
    for name, loc in formula_uses(spec):
        rival = loc[:2] == ("validate", "against") and loc[-1] not in ("static", "damping")
        if rival and name in SIMPLE:
            yield from _simple(spec, name, loc)
            continue
        if rival and name in BASELINES:
            yield from _baseline(spec, name, loc)
            continue
        formula = formula_called(spec, name)
        if formula is None:
            if name not in spec.own_formulas:  # else what is wrong with it is told where it is written
                known = (*literature.names(), *spec.own_formulas, *((*BASELINES, *SIMPLE) if rival else ()))
                yield Finding(loc, f"there is no literature model `{name}`", did_you_mean(name, known))
            continue
        if loc == ("model", "name") and not formula.inputs:
            yield Finding(loc, f"`{name}` is no function of anything", "name it in `validate.against`")
        for dimension in formula.dimensions:
            if loc == ("model", "backbone"):
                yield Finding(
                    loc, f"`{name}` has the {dimension} of the muscle, and is no backbone", f"use `type: literature` with `{name}`"
                )
            elif spec.muscle.lengths[dimension] is None:
                yield Finding(loc, f"`{name}` needs the {dimension} of the muscle", f"add `{dimension}: 10 mm` (your number) to `muscle`")
        for missing in [quantity for quantity in formula.inputs if quantity not in spec.quantities]:
            yield Finding(
                loc, f"`{name}` needs the quantity `{missing}`", f"add `{missing}` to `columns` or `derive`, or leave `{name}` out"
            )
    yield from _starts(spec)
    yield from _errors_in(spec)
    shown = [OWN, REPEATABILITY]
    for i, competitor in enumerate(spec.validation.against):
        name = competitor.label if isinstance(competitor, Competitor) else competitor
        if name in shown:
            remedy = "give this one a name: `{model: ..., as: NAME}`"
            yield Finding(("validate", "against", i), f"two models of the scores are named `{name}`", remedy)
        shown.append(name)


def _simple(spec: ExperimentSpec, name: str, loc: Loc) -> Iterator[Finding]:
    """Yield a simple competitor has what it is made of."""
    if name == "backbone" and spec.model.backbone is None:
        yield Finding(loc, "the model has no backbone", "give it one, as `model: {backbone: sarosi}`, or leave this out")
    if name == "arx" and not spec.runs_over_time:
        yield Finding(loc, "`arx` runs along recordings, and the model does not", "leave it out")


def _baseline(spec: ExperimentSpec, name: str, loc: Loc) -> Iterator[Finding]:
    """Yield a baseline needs the package that it comes from, and is always fitted in one way."""
    if find_spec("sklearn") is None:
        yield Finding(loc, f"`{name}` needs scikit-learn, which is not installed", "install the extra: `pip install 'mapmore[baselines]'`")
    competitor = spec.validation.against[int(loc[2])]
    if isinstance(competitor, Competitor) and competitor.method is not None:
        yield Finding((*loc[:3], "method"), f"`{name}` has no `method`", "remove it", on_key=True)


def _starts(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that starting values are published for the formula that they are wanted for."""
    against = enumerate(spec.validation.against)
    wanted = [(c.model, c.starts, ("validate", "against", i, "starts")) for i, c in against if isinstance(c, Competitor)]
    for name, starts, loc in [(spec.model.name, spec.model.starts, ("model", "starts")), *wanted]:
        formula = formula_called(spec, name)
        if formula is not None and starts is not None:
            try:
                formula.starting_from(starts)
            except SpecError as error:
                yield Finding(loc, error.message, error.remedy)


def _errors_in(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield an input whose error is minimised is one of the formula, which can be solved for it."""
    against = enumerate(spec.validation.against)
    wanted = [(c.model, c.errors_in, ("validate", "against", i, "errors_in")) for i, c in against if isinstance(c, Competitor)]
    for name, given, loc in [(spec.model.name, spec.model.errors_in, ("model", "errors_in")), *wanted]:
        formula = formula_called(spec, name)
        if formula is not None and given is not None:
            if not can_be_solved(formula):
                yield Finding(loc, f"`{name}` is fitted in a way of its own, to errors of the target", "remove it")
            elif given not in formula.inputs:
                yield Finding(loc, f"`{name}` has no input `{given}`", did_you_mean(given, formula.inputs))


def own_formulas(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield a formula of the spec's own has a name of its own, is an expression, and is linear in what has no bounds."""
    taken = {*literature.names(), *BASELINES, *SIMPLE, OWN, REPEATABILITY, AUTO}
    for i, one in enumerate(spec.formulas):
        if isinstance(one, str):
            yield Finding(("formulas", i), "this is no formula", "write `formulas: [my_formula.yaml]`, or the formula itself")
            continue
        if one.name in taken:
            yield Finding(("formulas", i, "name"), f"there is a model `{one.name}` already", "give this one another name")
        taken.add(one.name)
        loc = ("formulas", i, "expression")
        try:
            formula = _defined(spec, one)
        except ExpressionError as error:
            yield Finding(loc, f"not an expression: {error.message}", offset=error.position)
        except SpecError as error:
            yield Finding(("formulas", i, "units"), error.message, error.remedy)
        except ValueError as error:
            yield Finding(loc, str(error), "give `bounds` to every parameter in which it is not linear")
        else:
            if not formula.inputs:
                yield Finding(loc, "the formula depends on no quantity", "name one, as `pressure`, that is no parameter")
            for state in (name for name in formula.inputs if not name.isidentifier()):
                yield Finding(loc, f"`{state}` is a state with memory", "a formula is of quantities; put states into the `dictionary`")


def formula_called(spec: ExperimentSpec, name: str | None) -> LiteratureModel | None:
    """Return a formula of the literature, or of the spec's own; None for another name, or where it cannot be read."""
    if name is None:
        return None
    if name in spec.own_formulas:
        try:
            return _defined(spec, spec.own_formulas[name])
        except (ValueError, SpecError):
            return None
    return literature.get(name) if name in literature.names() else None


def _defined(spec: ExperimentSpec, one: OwnFormula) -> LiteratureModel:
    """Return a formula of the spec's own, in the model's units; raises as `OwnFormula.definition`."""
    units = {name: default_unit(name, spec.units) for name in (*spec.quantities, spec.target_quantity)}
    return formula_of(one.definition(units, units[spec.target_quantity]))


def formula_uses(spec: ExperimentSpec) -> Iterator[tuple[str, Loc]]:
    """Every formula that an experiment names, and where."""
    if spec.model.backbone not in (None, AUTO):
        yield str(spec.model.backbone), ("model", "backbone")
    if spec.model.name is not None:
        yield spec.model.name, ("model", "name")
    for i, competitor in enumerate(spec.validation.against):
        if isinstance(competitor, str):
            yield competitor, ("validate", "against", i)
            continue
        for key in ("model", "static", "damping"):
            name = getattr(competitor, key)
            if name is not None and (key, name) != ("static", OWN) and not (key == "model" and competitor.is_file):
                yield name, ("validate", "against", i, key)


def metrics(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that limits are set on numbers of the score row."""
    for name in spec.validation.require:
        if name not in METRICS:
            yield Finding(("validate", "require", name), f"there is no metric `{name}`", did_you_mean(name, METRICS), on_key=True)


def units(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require units that exist: the model's fit the canonical quantity, the columns' fit the model's."""
    known = dict.fromkeys((*spec.data.quantities, *CANONICAL))
    wrong = []
    for name, unit in spec.units.items():
        if name not in known:
            yield Finding(("units", name), f"there is no quantity `{name}` in this study", did_you_mean(name, known), on_key=True)
        found = list(_unit(("units", name), unit, default_unit(name) if is_canonical(name) else unit))
        wrong += [name] if found else []
        yield from found
    tables: list[tuple[Loc, Logs]] = [(("data",), spec.data), *((("data", "join", i), join) for i, join in enumerate(spec.data.join))]
    for loc, table in tables:
        for name, column in table.columns.items():
            if column.unit is not None and name not in wrong:
                yield from _unit((*loc, "columns", name, "unit"), column.unit, default_unit(name, spec.units))


def _unit(loc: Loc, unit: str, wanted: str) -> Iterator[Finding]:
    try:
        check_unit(unit)
        convert(1.0, unit, wanted)
    except SpecError as error:
        yield Finding(loc, error.message, error.remedy)
