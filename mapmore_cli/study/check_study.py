"""Check that the choices of an experiment fit each other: levels, held-out data, target, kind of
model, formulas, metrics and units.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from importlib.util import find_spec
from operator import attrgetter
from typing import TYPE_CHECKING, Protocol, get_args, runtime_checkable

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.domain.scores import METRICS, OF_TARGET, OWN, REPEATABILITY
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import ExpressionError
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.literature.own import formula_of
from mapmore_cli.modelling.pieces.recipe import CutByDirection, Cuts
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.modelling.simple import SIMPLE
from mapmore_cli.study.check_names import DERIVED, OF_NOTHING, unknown_quantity
from mapmore_cli.study.diagnostics import Finding, applying, did_you_mean, refused
from mapmore_cli.study.experiment import Competitor, ExperimentSpec, TargetColumn
from mapmore_cli.study.fields import TargetKind
from mapmore_cli.study.sections.data import STEP_OF
from mapmore_cli.study.sections.dictionary import (
    AlongRange,
    DictionaryEntry,
    Products,
    entries_of,
    feeds_back,
    texts_in,
)
from mapmore_cli.study.sections.logs import Logs
from mapmore_cli.study.sections.model import OwnFormula
from mapmore_cli.study.tree import Loc
from mapmore_cli.study.units import CANONICAL, check_unit, convert, default_unit, is_canonical

if TYPE_CHECKING:
    from mapmore_cli.modelling.literature import Formula

STATIC_RUN, REMOVE = "add `needs: {{static: my-static.yaml}}`", "remove it"
MOTION = ("damping", "dynamic")
"""Targets that have a static and a damping part."""


# Segments, levels and groups
# --------------------------------------------------------------------------------------------------


def segmented(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that each segmented quantity can be cut as the spec says, and that no level is the
    target.
    """
    level = spec.data.levels.of if spec.data.levels else None
    has_terms = spec.model.type == "mapmore" and bool(spec.dictionary)
    interpolated = has_terms and spec.segment.get(level or "") != "none" and not spec.has_memory
    if level == spec.target_quantity and (interpolated or spec.model.type == "auto"):
        what = f"the levels are those of `{level}`, which is the target itself"
        remedy = f"{OF_NOTHING}: name a quantity that is held constant in each recording"
        yield Finding("data.levels.of", what, remedy)
    for name, cut in spec.segment.items():
        by_direction = isinstance(cut, CutByDirection)
        yield from applying(
            (
                name == spec.target_quantity,
                "segment.{name}:",
                "`{name}` is the target itself",
                f"{OF_NOTHING}: remove it",
            ),
            (
                cut == "levels" and name != level,
                "segment.{name}",
                "`{name}` has no levels, because it is not the level quantity",
                "add `levels: {{of: {name}}}` to `data`, or cut it with `method: even`",
            ),
            (
                isinstance(cut, Cuts) and name == level,
                "segment.{name}:",
                "`{name}` is constant within a curve, so that it cannot be cut",
                "remove it, or write `{name}: none` to pool all levels",
            ),
            (
                getattr(cut, "method", None) == "optimal" and not has_terms,
                "segment.{name}:",
                "`optimal` finds boundaries by fitting terms, and `{type}` has no terms",
                "use another `method`, or remove it",
            ),
            (
                by_direction and name != DIRECTION,
                "segment.{name}:",
                f"only `{DIRECTION}` can be cut into rise and fall, not `{{name}}`",
                f"write `{DIRECTION}` as its name",
            ),
            (
                by_direction and name in spec.data.quantities,
                "segment.{name}:",
                "`{name}` is already a quantity of the data",
                "rename the quantity, or write `{name}: {{method: breakpoints, at: [0]}}` here",
            ),
            name=name,
            type=spec.model.type,
        )


def leaving_out(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check cross-validation: there are levels or groups that can be left out, and the model can be
    fitted without them.
    """
    data, whole = spec.data, spec.has_memory or spec.model.type == "sum"
    for way, example, there in (
        ("level", "pressure", data.levels is not None),
        ("group", "specimen", data.groups is not None),
    ):
        asked = getattr(data.split, f"leave_one_{way}_out")
        yield from applying(
            (
                asked and not there,
                "data.split.leave_one_{one}_out:",
                "there are no {one}s to leave out",
                "add `{one}s: {{of: {example}}}` to `data`",
            ),
            (
                asked and there and whole,
                "data.split.leave_one_{one}_out:",
                "a model with memory or a sum cannot be fitted with one of the {one}s left out",
                "hold out the end of recordings instead: `validate: {{last: 0.5}}`",
            ),
            one=way,
            example=example,
        )


def groups(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that a quantity distinguishes the groups, and that the data can determine their gains
    and offsets.
    """
    groups, left_out = spec.data.groups, spec.data.split.leave_one_group_out
    if groups is None:
        return
    yield from applying(
        (
            groups.of not in spec.data.quantities,
            "data.groups.of",
            "no recording has the quantity `{of}`, by which the groups are formed",
            "add it to `columns`, or write `set: {{{of}: 1}}` beside the files",
        ),
        *(
            (
                left_out and getattr(groups, effect),
                f"data.groups.{effect}:",
                (f"the {effect} of a left-out group is not known, so that it cannot be predicted"),
                f"remove `{effect}` or `leave_one_group_out`",
            )
            for effect in ("offset", "gain")
        ),
        (
            groups.offset and spec.target in DERIVED,
            "data.groups.offset:",
            "the {target} force is a difference of two forces, in which an offset cancels",
            "remove `offset`",
        ),
        of=groups.of,
        target=spec.target,
    )


def recordings_apart(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that the quantities whose values distinguish recordings come from columns."""
    of = spec.data.recordings.quantities if spec.data.recordings is not None else []
    missing = [name for name in of if name not in spec.data.measured or name == "time"]
    yield from applying(
        (
            bool(missing),
            "data.recordings.of",
            "no column is called `{name}`; its value would separate the recordings",
            "add it to `columns`, for example `{name}: {{column: ...}}`",
        ),
        name=", ".join(missing),
    )


def after_cycles(spec: ExperimentSpec) -> Iterator[Finding]:
    """Refuse settings that depend on the time of averaged branches, because their samples are in
    the order of `cycles.over`.
    """
    cycles, hold_out = spec.data.cycles, spec.data.split.hold_out
    if cycles is None:
        return
    held = hold_out is not None and "time" in hold_out.quantities
    uses: list[tuple[bool, Loc | str]] = [
        ("time" in spec.segment, "segment.time:"),
        (held, "data.split.validate.time:"),
    ]
    for loc, _, family in entries_of(spec.dictionary):
        uses += [
            (re.search(r"\btime\b", text) is not None, at) for at, text, _ in texts_in(loc, family)
        ]
    fault = "`cycles` sorts the samples by `{over}`, so that they have no `time` any more"
    remedy = "use `{over}` instead, or remove `cycles`"
    yield from applying(*((*use, fault, remedy) for use in uses), over=cycles.over)


def chosen_levels(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that the values of the level quantity in `split.validate` and `fit.train_level` are
    levels.
    """
    levels, hold_out, trains = spec.data.levels, spec.data.split.hold_out, spec.fit.train_level
    if levels is None:
        fault = "the data have no levels, so that none can be chosen"
        yield from applying((trains != "all", "fit.train_level:", fault, "add `levels` to `data`"))
    elif not isinstance(levels.at, str):
        values = hold_out.quantities.get(levels.of) if hold_out is not None else None
        reach = levels.within or (levels.spacing or 0) / 2
        asked: list[tuple[Loc, object, float]] = [(("fit", "train_level"), trains, 0.0)]
        for i, value in enumerate(values if isinstance(values, list) else ()):
            asked.append((("data", "split", "validate", levels.of, i), value, reach))
        known = f"the levels are {', '.join(f'{level:g}' for level in levels.at)}"
        for loc, level, off in asked:
            if isinstance(level, float) and min(abs(level - at) for at in levels.at) > off:
                yield Finding(loc, f"{level:g} is not a level of `{levels.of}`", known)


# Target and kind of model
# --------------------------------------------------------------------------------------------------


def target(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that everything exists from which the target is computed: its quantity, load cycles,
    plateaus, or the runs in `needs`.
    """
    needs, plateau, have = spec.needs, spec.data.plateau, spec.data.quantities
    missing = [f"`needs.{name}`" for name in ("static", "damping") if getattr(needs, name) is None]
    low, high = plateau if isinstance(plateau, tuple) else (0.0, 1.0)
    yield from applying(
        (
            isinstance(spec.target, str) and spec.target_quantity not in have,
            "target",
            "target `{target}` needs the quantity `{quantity}`",
            "add `{quantity}` to `columns`",
        ),
        (
            spec.target == "hysteresis" and spec.data.cycles is None,
            "target",
            "target `hysteresis` needs load cycles",
            "add `cycles: {{over: strain}}` to `data`",
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
            "add `needs: {{static: my-static.yaml, damping: my-damping.yaml}}`",
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
            f"the plateau ends before it begins: from {low:g} s to {high:g} s",
            "put the earlier time first",
        ),
        target=spec.target,
        quantity=spec.target_quantity,
    )


OF_ONE = (
    *("model.backbone", "data.cycles", "data.groups", "fit.shape", "fit.ridge", "fit.scale"),
    *("data.split.leave_one_level_out", "data.split.leave_one_group_out"),
    *("validate.as", "validate.intervals"),
)
"""Settings that apply to one target only."""
HELD = {
    "fit.scale": "fit.known_scale",
    "validate.as": "validation.as_",
    "validate.intervals": "validation.intervals",
}
"""Attribute of the spec that holds a setting, for settings whose attribute has another name."""


def several(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that several targets are modelled by pieces, or with memory of the inputs only."""
    if not spec.also:
        return
    names = spec.targets
    alone = f"write a separate spec for each of {', '.join(names)}"
    if spec.model.type == "auto":
        yield Finding(
            "target",
            "the structure search works for one target only, and this spec has several targets",
            f"write a `dictionary`, from which all targets get the same terms; or {alone}",
        )
    ways = [way for way in OF_ONE if attrgetter(HELD.get(way, way))(spec)]
    ways += ["model.type"] * (spec.model.type not in ("mapmore", "auto"))
    ways += ["fit.stop"] * (spec.fit.stop == "free_run")
    wrong = [(way, f"`{way.split('.')[-1]}` works for one target only") for way in ways]
    for name, cut in spec.segment.items():
        if isinstance(cut, Cuts) and cut.method == "gradient":
            wrong.append((f"segment.{name}", "`gradient` works for one target only"))
    for i, entry in enumerate(spec.dictionary):
        if entry.bounded:
            wrong.append((f"dictionary.{i}", "`sign` and `bounds` work for one target only"))
        wrong += [
            (
                f"dictionary.{i}",
                f"a term contains the target `{name}`, and only terms of inputs can be shared",
            )
            for name in names
            if feeds_back([entry], name)
        ]
    for name in dict.fromkeys(names):
        if names.count(name) > 1:
            wrong.append(("target", f"`{name}` is named twice"))
        if name in get_args(TargetKind):
            wrong.append(("target", f"`{name}` is a component of one target"))
    for way, fault in wrong:
        yield Finding(way, f"{fault}, and this spec has several targets", alone)


def kind(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that the spec has all settings that the kind of model needs, and that the model can be
    inverted if `validate.as` asks for it.
    """
    model, scored_as, is_pieces = spec.model, spec.validation.as_, spec.model.type == "mapmore"
    family = () if model.family is None else ("pressure", "strain", model.family.of)
    tries_fits = any(getattr(cut, "method", None) == "optimal" for cut in spec.segment.values())
    is_own = not isinstance(spec.target, TargetColumn) or scored_as == spec.target.column
    for name in family:
        yield from applying(
            (
                name not in spec.data.quantities,
                "model.family:",
                "a family needs the quantity `{name}`",
                "add `{name}` to `columns`, or `set` it beside the files",
            ),
            name=name,
        )
    weighed = sorted({"loss", "weight"} & {*spec.fit.changed})
    yield from applying(
        *(
            (
                not is_pieces,
                f"fit.{key}",
                (
                    "`{type}` is fitted by ordinary least squares, in which all samples count "
                    "the same"
                ),
                "remove it, or fit terms of a `dictionary`",
            )
            for key in weighed[:1]
        ),
        (
            model.backbone == AUTO and spec.has_memory,
            "model.backbone",
            "`auto` chooses by leaving out levels or blocks, which is not possible with memory",
            "name a formula, for example `sarosi`",
        ),
        (
            model.backbone == AUTO and tries_fits and not spec.has_memory,
            "model.backbone",
            "`auto` needs given segments, but `optimal` segments depend on the backbone",
            "name a formula, for example `sarosi`, or cut with `method: even`",
        ),
        (
            scored_as is not None and is_own,
            "validate.as",
            "`as: {scored_as}` needs a model of another quantity, which is then inverted",
            "set `target: {{column: strain}}`, or remove `as`",
        ),
        (
            scored_as is not None and not is_own and (spec.has_memory or not is_pieces),
            "validate.as",
            "only a model of pieces can be inverted for the scores",
            "remove `as`",
        ),
        type=model.type,
        scored_as=scored_as,
    )


@runtime_checkable
class Checked(Protocol):
    """A kind of model that a plugin adds, with its own check of the spec."""

    def findings(self, spec: ExperimentSpec) -> Iterable[Finding]:
        """Return the faults of a spec; nothing if its model is of another kind."""


def of_kinds(spec: ExperimentSpec) -> Iterator[Finding]:
    """Run the checks that only the plugin of a kind of model can make."""
    for kind in kinds():
        if isinstance(kind, Checked):
            yield from kind.findings(spec)


# Formulas and competitors
# --------------------------------------------------------------------------------------------------


def formula_called(spec: ExperimentSpec, name: str | None) -> Formula | None:
    """Return a formula of the literature or of the spec; None for an unknown name or an unreadable
    file.
    """
    if name in spec.own_formulas:
        try:
            return _defined(spec, spec.own_formulas[name])
        except (ValueError, SpecError):
            return None
    return literature.get(name) if name in literature.names() else None


def _defined(spec: ExperimentSpec, formula: OwnFormula) -> Formula:
    units = {
        name: default_unit(name, spec.units) for name in (*spec.quantities, spec.target_quantity)
    }
    return formula_of(formula.definition(units))


def unknown_formula(
    spec: ExperimentSpec, name: str | None, loc: Loc, others: Sequence[str] = ()
) -> Iterator[Finding]:
    """Yield a finding if no formula has the given name."""
    # a faulty own formula is reported at its definition
    if name is not None and name not in spec.own_formulas:
        known = (*literature.names(), *spec.own_formulas, *others)
        yield Finding(loc, f"there is no literature model `{name}`", did_you_mean(name, known))


def rivals_of(spec: ExperimentSpec) -> list[tuple[Loc, Competitor]]:
    """Return the competitors with their places; a bare name is the name of a model."""
    against = (
        Competitor.model_construct(model=rival) if isinstance(rival, str) else rival
        for rival in spec.validation.against
    )
    return [(("validate", "against", i), rival) for i, rival in enumerate(against)]


def formulas(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that formulas exist and that the study has the quantities that they need."""
    model = spec.model
    uses: list[tuple[Loc, str | None]] = [
        (("model", "name"), model.name),
        (("model", "backbone"), None if model.backbone == AUTO else model.backbone),
    ]
    for loc, rival in rivals_of(spec):
        if rival.model in (*SIMPLE, *LEARNERS):
            yield from _other_rival(spec, rival.model, rival, loc)
        elif rival.as_ is None or not rival.is_file:
            uses += [((*loc, "model"), rival.model)]
        uses += [((*loc, "static"), None if rival.static == OWN else rival.static)]
        uses += [((*loc, "damping"), rival.damping)]
    for loc, name in uses:
        formula = formula_called(spec, name)
        if name is None or formula is None:
            is_rival = loc[0] == "validate" and loc[-1] == "model"
            yield from unknown_formula(spec, name, loc, (*LEARNERS, *SIMPLE) if is_rival else ())
        else:
            yield from _needs(spec, name, formula, loc)


def _needs(spec: ExperimentSpec, name: str, formula: Formula, loc: Loc) -> Iterator[Finding]:
    is_own, is_backbone = loc[0] == "model", loc == ("model", "backbone")
    of_cycles = formula.fitted_to == literature.LOAD_CYCLES
    beside, muscle = "use it as a competitor: name it in `validate.against`", spec.muscle
    beyond = "use `type: literature` with `{name}`" if is_backbone else None
    yield from applying(
        (
            loc == ("model", "name") and not formula.inputs,
            loc,
            "`{name}` has no inputs, so that it cannot be the model",
            beside,
        ),
        *(
            (
                is_backbone or muscle.lengths[dimension] is None,
                loc,
                f"`{{name}}` needs the {dimension} of the muscle",
                beyond or f"add `{dimension}: 10 mm` (with your own number) to `muscle`",
            )
            for dimension in formula.dimensions
        ),
        *(
            (
                missing not in spec.quantities,
                loc,
                f"`{{name}}` needs the quantity `{missing}`",
                f"add `{missing}` to `columns` or `derive`, or leave `{{name}}` out",
            )
            for missing in formula.inputs
        ),
        (of_cycles and is_own, loc, "`{name}` is fitted to load cycles, not to a target", beside),
        (
            of_cycles and not is_own and (spec.needs.static is None or spec.target not in MOTION),
            loc,
            "`{name}` is fitted to the load cycles of a static run, and there is none",
            STATIC_RUN,
        ),
        (
            of_cycles and not is_own and muscle.length is None,
            loc,
            "`{name}` needs the length of the muscle",
            "add `length: 88 mm` (with your own number) to `muscle`",
        ),
        name=name,
    )


def _other_rival(spec: ExperimentSpec, name: str, rival: Competitor, loc: Loc) -> Iterator[Finding]:
    is_box = name in LEARNERS
    yield from applying(
        (
            name == "backbone" and spec.model.backbone is None,
            loc,
            "the model has no backbone that could be scored",
            "add one, for example `model: {{backbone: sarosi}}`, or remove this competitor",
        ),
        (
            name == "arx" and not spec.runs_over_time,
            loc,
            "`arx` is simulated along recordings, but this model is not",
            "leave `arx` out",
        ),
        (
            is_box and find_spec("sklearn") is None,
            loc,
            "`{name}` needs scikit-learn, which is not installed",
            "install the extra: `pip install 'mapmore[baselines]'`",
        ),
        (is_box and rival.method is not None, (*loc, "method"), "`{name}` has no `method`", REMOVE),
        name=name,
    )


def competitors(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that formulas can be fitted by the chosen method, and that competitors have distinct
    names and data to be fitted to.
    """
    shown, moves = [OWN, REPEATABILITY], spec.target in MOTION
    for loc, rival in rivals_of(spec):
        formula, composite = formula_called(spec, rival.model), rival.static is not None
        if formula is not None and rival.starts is not None:
            yield from refused((*loc, "starts"), formula.starting_from, rival.starts)
        yield from applying(
            (
                composite and not moves,
                loc,
                "target `{target}` has no static and damping parts",
                "give one `model`",
            ),
            (
                composite and moves and spec.needs.static is None,
                loc,
                "the static part is fitted to the data of the static run, and there is none",
                STATIC_RUN,
            ),
            (
                rival.label in shown,
                loc,
                "two models in the table of scores have the name `{label}`",
                "give this one a name: `{{model: ..., as: NAME}}`",
            ),
            target=spec.target,
            label=rival.label,
        )
        at_levels = rival.levels is not None
        yield from applying(
            (
                at_levels and rival.model is not None and formula is None and not rival.is_file,
                (*loc, "levels"),
                "`levels` needs a formula, and `{model}` is not one",
                REMOVE,
            ),
            (
                at_levels and spec.data.levels is None,
                (*loc, "levels"),
                "the data have no levels",
                "add `levels: {{of: ...}}` to `data`, or remove `levels` here",
            ),
            model=rival.model,
        )
        shown.append(rival.label)


def own_formulas(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that a formula of the spec has a name that is not in use, a valid expression, and is
    linear in every parameter without bounds.
    """
    names = {*literature.names(), *LEARNERS, *SIMPLE, OWN, REPEATABILITY, AUTO}
    for i, formula in enumerate(spec.formulas):
        if isinstance(formula, str):
            fault, remedy = "this is not a formula", "write `formulas: [my_formula.yaml]`"
            yield Finding(f"formulas.{i}", fault, f"{remedy}, or write the formula itself here")
            continue
        if formula.name in names:
            fault = f"there is already a model `{formula.name}`"
            yield Finding(f"formulas.{i}.name", fault, "give this one another name")
        names.add(formula.name)
        place, inputs = f"formulas.{i}.expression", None
        try:
            inputs = _defined(spec, formula).inputs
        except ExpressionError as error:
            yield Finding(place, f"not a valid expression: {error.message}", offset=error.position)
        except SpecError as error:
            yield Finding(f"formulas.{i}.units", error.message, error.remedy)
        except ValueError as error:
            remedy = (
                "give `bounds` to every parameter on which the expression does not depend linearly"
            )
            yield Finding(place, str(error), remedy)
        yield from applying(
            (
                inputs == (),
                place,
                "the formula depends on no quantity of the study",
                "use a quantity, for example `pressure`, that is not declared as a parameter",
            ),
            *(
                (
                    not name.isidentifier(),
                    place,
                    f"`{name}` has memory, which a formula must not have",
                    "use quantities only, and put terms with memory into the `dictionary`",
                )
                for name in inputs or ()
            ),
        )


def shapes(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that shapes concern quantities of the study and models that can keep them, and that the
    fit can identify every term whose coefficient has bounds.
    """
    fit, target = spec.fit, spec.target_quantity
    is_other = spec.model.type not in ("mapmore", "literature")
    weighed = fit.loss != "squares" or fit.weight == "curve"
    kept = fit.shape is not None or any(entry.bounded for entry in spec.dictionary)
    yield from applying(
        (
            weighed and kept,
            "fit.loss" if fit.loss != "squares" else "fit.weight",
            (
                "shapes, signs and bounds are kept by least squares in which all samples count "
                "the same"
            ),
            "use `loss: squares` and `weight: sample` with them",
        )
    )
    for name, words in (fit.shape or {}).items():
        loc: Loc = ("fit", "shape", name)
        yield from unknown_quantity(name, (*spec.quantities, target), loc, on_key=True)
        given_words = {words} if isinstance(words, str) else {*words}
        yield from applying(
            (
                (name == target) != (given_words == {"positive"}),
                loc,
                "`positive` applies to the target, and all other words apply to inputs",
                "write `{target}: positive`, or use another word for the input",
            ),
            (
                is_other,
                loc,
                (
                    "this type of model cannot keep a shape; pieces, formulas and terms with "
                    "memory can"
                ),
                REMOVE,
            ),
            (
                spec.has_memory and not given_words <= {"increasing", "decreasing"},
                loc,
                "a model with memory can keep only the sign of its static gain",
                "write `increasing` or `decreasing`",
            ),
            target=target,
        )
    for i, entry in enumerate(spec.dictionary):
        _, family = entry.family
        inner = family.of if isinstance(family, Products) else []
        yield from applying(
            (
                entry.bounded and (spec.has_memory or isinstance(family, AlongRange)),
                f"dictionary.{i}",
                (
                    "`sign` and `bounds` work only for pieces, and for terms that do not "
                    "depend on the training range"
                ),
                "remove them",
            ),
            (
                any(isinstance(entry, DictionaryEntry) and entry.bounded for entry in inner),
                f"dictionary.{i}",
                "`sign` and `bounds` have no effect within products",
                "write them beside `products`",
            ),
        )


# Metrics and units
# --------------------------------------------------------------------------------------------------


def metrics(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that limits concern metrics of the score row. With several targets, a metric in the
    unit of a target needs a limit for each of them.
    """
    targets = {*spec.targets} if spec.also else set[str]()
    for name, limit in spec.validation.require.items():
        loc = ("validate", "require", name)
        named = {*limit} if isinstance(limit, dict) else set[str]()
        if name not in METRICS:
            fault = f"there is no metric `{name}`"
            yield Finding(loc, fault, did_you_mean(name, METRICS), on_key=True)
        elif named - targets or (targets and not named and name in OF_TARGET):
            fault = (
                f"a limit of `{name}` is one number, or with several targets one number for each"
            )
            yield Finding(loc, fault, f"write `{name}: 1`, or `{name}: {{tip_x: 1, tip_y: 2}}`")


def units(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that units exist and have the right dimension: the units of the model suit the
    canonical quantities, and the units of columns can be converted to the units of the model.
    """
    known, wrong = (*spec.data.quantities, *CANONICAL), set[str]()
    for name, unit in spec.units.items():
        yield from unknown_quantity(name, known, ("units", name), on_key=True)
        for finding in _unit_findings(
            ("units", name), unit, default_unit(name) if is_canonical(name) else unit
        ):
            wrong.add(name)
            yield finding
    for name, unit in spec.report.units.items():
        in_model = default_unit(name, spec.units)
        faults = _unit_findings(("report", "units", name), unit, in_model)
        yield from faults
        if not faults and name not in wrong and convert(0.0, unit, in_model) != 0:
            yield Finding(
                ("report", "units", name),
                f"the zero of `{unit}` differs from that of `{in_model}`, but an equation can "
                "only be scaled",
                f"use one unit in the whole study: `units: {{{name}: {unit}}}`",
            )
    tables: list[tuple[Loc, Logs]] = [(("data",), spec.data)]
    tables += [(("data", "join", i), join) for i, join in enumerate(spec.data.join)]
    for loc, table in tables:
        for name, column in table.columns.items():
            if column.unit is not None and name not in wrong:
                place = (*loc, "columns", name, "unit")
                yield from _unit_findings(place, column.unit, default_unit(name, spec.units))


def _unit_findings(loc: Loc, unit: str, wanted: str) -> list[Finding]:
    return [*refused(loc, check_unit, unit)] or [*refused(loc, convert, 1.0, unit, wanted)]


CHECKS = (
    *(
        segmented,
        leaving_out,
        groups,
        recordings_apart,
        after_cycles,
        chosen_levels,
        target,
        kind,
        of_kinds,
    ),
    *(formulas, competitors, own_formulas, shapes, units),
)
"""The checks of this file. Each yields its findings for a spec."""
