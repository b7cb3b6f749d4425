"""Checks that the choices of an experiment fit each other: levels, hold-out, target, the kind of
model, formulas, metrics, units.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from operator import attrgetter
from types import MappingProxyType
from typing import TYPE_CHECKING, get_args

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.domain.scores import BASELINES, METRICS, OWN, REPEATABILITY, SIMPLE
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import ExpressionError
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.modelling.literature.own import formula_of
from mapmore_cli.modelling.pieces.recipe import CutByDirection, Cuts
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.spec.check_names import DERIVED, OF_NOTHING, unknown_quantity
from mapmore_cli.spec.diagnostics import Finding, did_you_mean, refused, told
from mapmore_cli.spec.experiment import Competitor, ExperimentSpec, TargetColumn
from mapmore_cli.spec.fields import TargetKind
from mapmore_cli.spec.sections.data import STEP_OF
from mapmore_cli.spec.sections.dictionary import (
    AlongRange,
    DictionaryEntry,
    Products,
    entries_of,
    feeds_back,
    texts_in,
)
from mapmore_cli.spec.sections.logs import Logs
from mapmore_cli.spec.sections.model import OwnFormula
from mapmore_cli.spec.tree import Loc
from mapmore_cli.spec.units import CANONICAL, check_unit, convert, default_unit, is_canonical

if TYPE_CHECKING:
    from mapmore_cli.modelling.literature import Formula

STATIC_RUN = "add `needs: {static: my-static.yaml}`"
MOTION = ("damping", "dynamic")
"""Targets that are made of a static and a damping part."""


# Segments, levels and groups
# --------------------------------------------------------------------------------------------------


def segmented(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check what each segmented quantity is cut by."""
    level = spec.data.levels.of if spec.data.levels else None
    has_terms = spec.model.type == "mapmore" and bool(spec.dictionary)
    for name, cut in spec.segment.items():
        key, is_cut = f"segment.{name}:", isinstance(cut, Cuts)
        tries_fits = isinstance(cut, Cuts) and cut.method == "optimal"
        by_direction = isinstance(cut, CutByDirection)
        yield from told(
            (
                name == spec.target_quantity,
                key,
                f"`{name}` is the target",
                f"{OF_NOTHING}: take it out",
            ),
            (
                cut == "levels" and name != level,
                f"segment.{name}",
                f"`{name}` has no levels",
                f"add `levels: {{of: {name}}}` to `data`, or cut it by `method: even`",
            ),
            (
                is_cut and name == level,
                key,
                f"`{name}` is constant within a curve and cannot be cut",
                f"remove it; or write `{name}: none` to pool all levels",
            ),
            (
                tries_fits and not has_terms,
                key,
                f"`optimal` places boundaries by fits of terms, and `{spec.model.type}` has none",
                "use another `method`, or remove it",
            ),
            (
                by_direction and name != DIRECTION,
                key,
                f"`{name}` has no rise and fall",
                f"call it `{DIRECTION}`",
            ),
            (
                by_direction and name in spec.data.quantities,
                key,
                f"`{name}` is a quantity of the data already",
                f"remove it there, or write `{name}: {{method: breakpoints, at: [0]}}` here",
            ),
        )


def leaving_out(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require levels or groups that can be left out, and a model that can be fitted without
    them.
    """
    data, split = spec.data, spec.data.split
    whole = spec.has_memory or spec.model.type == "sum"
    for key, asked, given, what, example in (
        ("leave_one_level_out", split.leave_one_level_out, data.levels, "levels", "{of: pressure}"),
        ("leave_one_group_out", split.leave_one_group_out, data.groups, "groups", "{of: specimen}"),
    ):
        yield from told(
            (
                asked and given is None,
                f"data.split.{key}:",
                f"there are no {what} to leave out",
                f"add `{what}: {example}` to `data`",
            ),
            (
                asked and given is not None and whole,
                f"data.split.{key}:",
                f"neither a model with memory nor a sum can be fitted without one of the {what}",
                "hold out recordings, as `validate: {last: 0.5}`",
            ),
        )


def groups(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require a quantity that tells groups apart, and gains and offsets that can be known."""
    of = spec.data.groups
    if of is None:
        return
    yield from told(
        (
            of.of not in spec.data.quantities,
            "data.groups.of",
            f"no recording has the quantity `{of.of}`",
            f"add it to `columns`, or `set: {{{of.of}: 1}}` beside the files",
        ),
        *(
            (
                asked and spec.data.split.leave_one_group_out,
                f"data.groups.{effect}:",
                f"the {effect} of a group that is left out is not known",
                f"remove `{effect}` or `leave_one_group_out`",
            )
            for effect, asked in (("offset", of.offset), ("gain", of.gain))
        ),
        (
            of.offset and spec.target in DERIVED,
            "data.groups.offset:",
            f"the {spec.target} force is a difference, which no offset changes",
            "remove `offset`",
        ),
    )


def after_cycles(spec: ExperimentSpec) -> Iterator[Finding]:
    """Refuse what goes by the time of joined branches: their samples stand in the order of
    `cycles.over`.
    """
    cycles, hold_out = spec.data.cycles, spec.data.split.hold_out
    if cycles is None:
        return
    uses: list[Loc | str] = ["segment.time:"] if "time" in spec.segment else []
    if hold_out is not None and "time" in hold_out.quantities:
        uses.append("data.split.validate.time:")
    for loc, _, family in entries_of(spec.dictionary):
        uses += [at for at, text, _ in texts_in(loc, family) if re.search(r"\btime\b", text)]
    what = f"`cycles` puts samples in the order of `{cycles.over}`: they have no `time` any more"
    for way in uses:
        yield Finding(way, what, f"name `{cycles.over}`, or remove `cycles`")


def chosen_levels(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that values of the level quantity that are held out, or train alone, are levels."""
    levels, hold_out, trains = spec.data.levels, spec.data.split.hold_out, spec.fit.train_level
    if levels is None:
        what = "there are no levels to choose from"
        yield from told((trains != "all", "fit.train_level:", what, "add `levels` to `data`"))
    elif not isinstance(levels.at, str):
        asked: list[tuple[Loc, float]] = []
        if not isinstance(trains, str) and trains not in levels.at:
            asked.append((("fit", "train_level"), trains))
        values = hold_out.quantities.get(levels.of) if hold_out is not None else None
        reach = levels.within or (levels.spacing or 0) / 2
        for i, value in enumerate(values if isinstance(values, list) else ()):
            if min(abs(value - level) for level in levels.at) > reach:
                asked.append((("data", "split", "validate", levels.of, i), value))
        known = f"levels are {', '.join(f'{level:g}' for level in levels.at)}"
        for loc, value in asked:
            yield Finding(loc, f"{value:g} is no level of `{levels.of}`", known)


# Target and kind of model
# --------------------------------------------------------------------------------------------------


def target(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require what a target is made of: its quantity, load cycles, plateaus, the runs that it
    builds on.
    """
    quantity, needs, plateau, have = (
        spec.target_quantity,
        spec.needs,
        spec.data.plateau,
        spec.data.quantities,
    )
    missing = [f"`needs.{name}`" for name in ("static", "damping") if getattr(needs, name) is None]
    low, high = plateau if isinstance(plateau, tuple) else (0.0, 1.0)
    yield from told(
        (
            not isinstance(spec.target, TargetColumn) and quantity not in have,
            "target",
            f"target `{spec.target}` needs the quantity `{quantity}`",
            f"add `{quantity}` to `columns`",
        ),
        (
            spec.target == "hysteresis" and spec.data.cycles is None,
            "target",
            "target `hysteresis` needs load cycles",
            "add `cycles: {over: strain}` to `data`",
        ),
        (
            spec.target == "damping" and needs.static is None,
            "target",
            "target `damping` needs a static model",
            STATIC_RUN,
        ),
        (
            spec.target == "damping" and plateau is None,
            "target",
            "target `damping` needs the plateau of each step response",
            "add `plateau: auto` to `data`, or `plateau: [2 s, 3 s]`",
        ),
        (
            spec.model.type == "sum" and spec.model.sum is None and bool(missing),
            "target",
            f"the sum of two models needs {' and '.join(missing)}",
            "add `needs: {static: my-static.yaml, damping: my-damping.yaml}`",
        ),
        *(
            (
                plateau is not None and name not in have,
                "data.plateau:",
                f"`plateau` needs the quantity `{name}`",
                f"add `{name}` to `columns`",
            )
            for name in ("time", STEP_OF)
        ),
        (
            low >= high,
            "data.plateau",
            f"the plateau runs from {low:g} s to {high:g} s",
            "put the earlier time first",
        ),
    )


OF_ONE = MappingProxyType(
    {
        **{way: way for way in ("model.backbone", "data.cycles", "data.groups", "fit.shape")},
        **{
            f"data.split.{key}": f"data.split.{key}"
            for key in ("leave_one_level_out", "leave_one_group_out")
        },
        **{"fit.ridge": "fit.ridge", "fit.scale": "fit.known_scale"},
        **{"validate.as": "validation.as_", "validate.intervals": "validation.intervals"},
    }
)
"""Settings that are about one target where they are set, and where the spec holds them."""


def several(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require pieces, or memory of the inputs alone, where several targets share their terms."""
    if not spec.also:
        return
    names = (spec.target_quantity, *spec.also)
    ways = [way for way, place in OF_ONE.items() if attrgetter(place)(spec)]
    ways += ["model.type"] * (spec.model.type != "mapmore")
    ways += ["fit.stop"] * (spec.fit.stop == "free_run")
    wrong = [(way, f"`{way.split('.')[-1]}` is about one target") for way in ways]
    for name, cut in spec.segment.items():
        if isinstance(cut, Cuts) and cut.method == "gradient":
            wrong.append((f"segment.{name}", "`gradient` is about one target"))
    for i, entry in enumerate(spec.dictionary):
        if entry.bounded:
            wrong.append((f"dictionary.{i}", "`sign` and `bounds` are about one target"))
        wrong += [
            (f"dictionary.{i}", f"a term is of the target `{name}`, and they share those of inputs")
            for name in names
            if feeds_back([entry], name)
        ]
    for name in dict.fromkeys(names):
        if names.count(name) > 1:
            wrong.append(("target", f"`{name}` is named twice"))
        if name in get_args(TargetKind):
            wrong.append(("target", f"`{name}` is a component of one target"))
    remedy = f"write a spec for each of {', '.join(names)}"
    for way, what in wrong:
        yield Finding(way, f"{what}, and there are several", remedy)


def kind(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require what the kind of model is made of, and a model that can be inverted where it is
    scored as one of its inputs.
    """
    model, scored_as = spec.model, spec.validation.as_
    family = () if model.family is None else ("pressure", "strain", model.family.of)
    tries_fits = any(
        isinstance(cut, Cuts) and cut.method == "optimal" for cut in spec.segment.values()
    )
    is_own = not isinstance(spec.target, TargetColumn) or scored_as == spec.target.column
    weighed = {"loss", "weight"} & {*spec.fit.changed}
    yield from told(
        (
            bool(weighed) and model.type != "mapmore",
            f"fit.{min(weighed, default='')}",
            f"`{model.type}` fits all samples alike, by squares",
            "remove it, or fit terms of a `dictionary`",
        ),
        *(
            (
                name not in spec.data.quantities,
                "model.family:",
                f"a family needs the quantity `{name}`",
                f"add `{name}` to `columns`, or `set` it beside the files",
            )
            for name in family
        ),
        (
            model.backbone == AUTO and spec.has_memory,
            "model.backbone",
            "`auto` chooses by left-out levels or blocks, and a model with memory has none",
            "name a formula, as `sarosi`",
        ),
        (
            model.backbone == AUTO and tries_fits and not spec.has_memory,
            "model.backbone",
            "`auto` chooses for given segments, and `optimal` ones depend on the backbone",
            "name a formula, as `sarosi`, or cut `even`",
        ),
        (
            scored_as is not None and is_own,
            "validate.as",
            f"`{scored_as}` needs a model of another quantity to be inverted",
            "set `target: {column: strain}`, or remove `as`",
        ),
        (
            scored_as is not None and not is_own and (spec.has_memory or model.type != "mapmore"),
            "validate.as",
            "only a model of pieces can be inverted to be scored",
            "remove `as`",
        ),
    )


def of_kinds(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check what only the kind of a model that adds itself knows."""
    for kind in kinds():
        yield from kind.verb("findings", lambda _spec: (), of="checks")(spec)


# Formulas and competitors
# --------------------------------------------------------------------------------------------------


def formula_called(spec: ExperimentSpec, name: str | None) -> Formula | None:
    """Return a formula of the literature, or of the spec's own; None for another name, or where it
    cannot be read.
    """
    if name in spec.own_formulas:
        try:
            return _defined(spec, spec.own_formulas[name])
        except (ValueError, SpecError):
            return None
    return literature.get(name) if name in literature.names() else None


def _defined(spec: ExperimentSpec, one: OwnFormula) -> Formula:
    units = {
        name: default_unit(name, spec.units) for name in (*spec.quantities, spec.target_quantity)
    }
    return formula_of(one.definition(units))


def unknown_formula(
    spec: ExperimentSpec, name: str | None, loc: Loc, others: Sequence[str] = ()
) -> Iterator[Finding]:
    """Tell that no formula has a name, at a place of the spec."""
    # what is wrong with one of its own is told where it is written
    if name is not None and name not in spec.own_formulas:
        known = (*literature.names(), *spec.own_formulas, *others)
        yield Finding(loc, f"there is no literature model `{name}`", did_you_mean(name, known))


def rivals_of(spec: ExperimentSpec) -> list[tuple[Loc, Competitor]]:
    """Return the competitors with their places; a name alone is that of a model."""
    against = (
        Competitor.model_construct(model=one) if isinstance(one, str) else one
        for one in spec.validation.against
    )
    return [(("validate", "against", i), one) for i, one in enumerate(against)]


def formulas(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that formulas exist and find what they need in the study."""
    uses: list[tuple[Loc, str | None]] = [(("model", "name"), spec.model.name)]
    uses += [(("model", "backbone"), spec.model.backbone)] if spec.model.backbone != AUTO else []
    for loc, rival in rivals_of(spec):
        if rival.model in (*SIMPLE, *BASELINES):
            yield from _other_rival(spec, rival.model, rival, loc)
        elif rival.as_ is None or not rival.is_file:
            uses += [((*loc, "model"), rival.model)]
        uses += [((*loc, "static"), rival.static)] if rival.static != OWN else []
        uses += [((*loc, "damping"), rival.damping)]
    for loc, name in uses:
        formula = formula_called(spec, name)
        if name is None or formula is None:
            yield from unknown_formula(
                spec,
                name,
                loc,
                (*BASELINES, *SIMPLE) if loc[0] == "validate" and loc[-1] == "model" else (),
            )
        else:
            yield from _needs(spec, name, formula, loc)


def _needs(spec: ExperimentSpec, name: str, formula: Formula, loc: Loc) -> Iterator[Finding]:
    is_own, is_backbone = loc[0] == "model", loc == ("model", "backbone")
    of_cycles = formula.fitted_to == literature.LOAD_CYCLES
    beside, muscle = "name it in `validate.against`", spec.muscle
    yield from told(
        (
            loc == ("model", "name") and not formula.inputs,
            loc,
            f"`{name}` is no function of anything",
            beside,
        ),
        *(
            (
                is_backbone or muscle.lengths[dimension] is None,
                loc,
                f"`{name}` needs the {dimension} of the muscle",
                f"use `type: literature` with `{name}`"
                if is_backbone
                else f"add `{dimension}: 10 mm` (your number) to `muscle`",
            )
            for dimension in formula.dimensions
        ),
        *(
            (
                True,
                loc,
                f"`{name}` needs the quantity `{missing}`",
                f"add `{missing}` to `columns` or `derive`, or leave `{name}` out",
            )
            for missing in formula.inputs
            if missing not in spec.quantities
        ),
        (of_cycles and is_own, loc, f"`{name}` is fitted to load cycles, not to a target", beside),
        (
            of_cycles and not is_own and (spec.needs.static is None or spec.target not in MOTION),
            loc,
            f"`{name}` is fitted to the load cycles of a static run",
            STATIC_RUN,
        ),
        (
            of_cycles and not is_own and muscle.length is None,
            loc,
            f"`{name}` needs the length of the muscle",
            "add `length: 88 mm` to `muscle`",
        ),
    )


def _other_rival(spec: ExperimentSpec, name: str, rival: Competitor, loc: Loc) -> Iterator[Finding]:
    yield from told(
        (
            name == "backbone" and spec.model.backbone is None,
            loc,
            "the model has no backbone",
            "give it one, as `model: {backbone: sarosi}`, or leave this out",
        ),
        (
            name == "arx" and not spec.runs_over_time,
            loc,
            "`arx` runs along recordings, and the model does not",
            "leave it out",
        ),
        (
            name in BASELINES and find_spec("sklearn") is None,
            loc,
            f"`{name}` needs scikit-learn, which is not installed",
            "install the extra: `pip install 'mapmore[baselines]'`",
        ),
        (
            name in BASELINES and rival.method is not None,
            (*loc, "method"),
            f"`{name}` has no `method`",
            "remove it",
        ),
    )


def competitors(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that formulas can be fitted in the way that is wanted, and competitors have names of
    their own and data to be fitted to.
    """
    shown = [OWN, REPEATABILITY]
    for loc, rival in rivals_of(spec):
        formula = formula_called(spec, rival.model)
        if formula is not None and rival.starts is not None:
            yield from refused((*loc, "starts"), formula.starting_from, rival.starts)
        composite = rival.static is not None
        yield from told(
            (
                composite and spec.target not in MOTION,
                loc,
                f"target `{spec.target}` has no static and damping parts",
                "give one `model`",
            ),
            (
                composite and spec.target in MOTION and spec.needs.static is None,
                loc,
                "a static formula is fitted to the data of the static run",
                STATIC_RUN,
            ),
            (
                rival.label in shown,
                loc,
                f"two models of the scores are named `{rival.label}`",
                "give this one a name: `{model: ..., as: NAME}`",
            ),
        )
        shown.append(rival.label)


def own_formulas(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that a formula of the spec's own has a name of its own, is an expression, and is
    linear in what has no bounds.
    """
    taken = {*literature.names(), *BASELINES, *SIMPLE, OWN, REPEATABILITY, AUTO}
    for i, one in enumerate(spec.formulas):
        if isinstance(one, str):
            yield Finding(
                ("formulas", i),
                "this is no formula",
                "write `formulas: [my_formula.yaml]`, or the formula itself",
            )
            continue
        if one.name in taken:
            yield Finding(
                ("formulas", i, "name"),
                f"there is a model `{one.name}` already",
                "give this one another name",
            )
        taken.add(one.name)
        loc = ("formulas", i, "expression")
        try:
            inputs = _defined(spec, one).inputs
        except ExpressionError as error:
            yield Finding(loc, f"not an expression: {error.message}", offset=error.position)
        except SpecError as error:
            yield Finding(("formulas", i, "units"), error.message, error.remedy)
        except ValueError as error:
            yield Finding(
                loc, str(error), "give `bounds` to every parameter in which it is not linear"
            )
        else:
            if not inputs:
                yield Finding(
                    loc,
                    "the formula depends on no quantity",
                    "name one, as `pressure`, that is no parameter",
                )
            for state in (name for name in inputs if not name.isidentifier()):
                yield Finding(
                    loc,
                    f"`{state}` is a state with memory",
                    "a formula is of quantities; put states into the `dictionary`",
                )


def shapes(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require shapes of quantities of the study, of models that can keep them, and bounds of terms
    that the fit can find again.
    """
    target, no_terms = spec.target_quantity, spec.model.type not in ("mapmore", "literature")
    bounded = any(entry.bounded for entry in spec.dictionary)
    weighed = spec.fit.loss != "squares" or spec.fit.weight == "curve"
    yield from told(
        (
            weighed and (spec.fit.shape is not None or bounded),
            ("fit", "loss" if spec.fit.loss != "squares" else "weight"),
            "a shape, a sign and bounds are kept by least squares over samples",
            "use `loss: squares` and `weight: sample` with them",
        )
    )
    for name, words in (spec.fit.shape or {}).items():
        loc: Loc = ("fit", "shape", name)
        yield from unknown_quantity(name, (*spec.quantities, target), loc, on_key=True)
        positive = {words} if isinstance(words, str) else {*words}
        yield from told(
            (
                (name == target) != (positive == {"positive"}),
                loc,
                "`positive` is about the target, and all other words are about an input",
                f"write `{target}: positive`, or another word of an input",
            ),
            (
                no_terms or spec.has_memory,
                loc,
                "a shape is kept by pieces and formulas, and this model is neither",
                "remove it",
            ),
        )
    for i, entry in enumerate(spec.dictionary):
        inner = entry.family[1].of if isinstance(entry.family[1], Products) else []
        nested = [one for one in inner if isinstance(one, DictionaryEntry)]
        yield from told(
            (
                entry.bounded and (spec.has_memory or isinstance(entry.family[1], AlongRange)),
                ("dictionary", i),
                "`sign` and `bounds` are of coefficients of pieces, and of terms that do not "
                "change with the training range",
                "remove them",
            ),
            (
                any(one.bounded for one in nested),
                ("dictionary", i),
                "`sign` and `bounds` inside of products say nothing",
                "write them beside `products`",
            ),
        )


# Metrics and units
# --------------------------------------------------------------------------------------------------


def metrics(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that limits are set on numbers of the score row."""
    for name in spec.validation.require:
        if name not in METRICS:
            yield Finding(
                ("validate", "require", name),
                f"there is no metric `{name}`",
                did_you_mean(name, METRICS),
                on_key=True,
            )


def units(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require units that exist: the model's fit the canonical quantity, the columns' fit the
    model's.
    """
    known = (*spec.data.quantities, *CANONICAL)
    wrong = []
    for name, unit in spec.units.items():
        yield from unknown_quantity(name, known, ("units", name), on_key=True)
        found = _unit_findings(
            ("units", name), unit, default_unit(name) if is_canonical(name) else unit
        )
        wrong += [name] if found else []
        yield from found
    tables: list[tuple[Loc, Logs]] = [
        (("data",), spec.data),
        *((("data", "join", i), join) for i, join in enumerate(spec.data.join)),
    ]
    for loc, table in tables:
        for name, column in table.columns.items():
            if column.unit is not None and name not in wrong:
                yield from _unit_findings(
                    (*loc, "columns", name, "unit"), column.unit, default_unit(name, spec.units)
                )


def _unit_findings(loc: Loc, unit: str, wanted: str) -> list[Finding]:
    return [*refused(loc, check_unit, unit)] or [*refused(loc, convert, 1.0, unit, wanted)]
