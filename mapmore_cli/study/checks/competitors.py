"""Check the formulas and black boxes with which a model is compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.scores import OWN, REPEATABILITY
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import ExpressionError
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.literature.own import formula_of
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.modelling.simple import SIMPLE
from mapmore_cli.study.checks.remedies import REMOVE, STATIC_RUN
from mapmore_cli.study.checks.target import MOTION
from mapmore_cli.study.diagnostics import Finding, applying, did_you_mean, refused
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.model import OwnFormula
from mapmore_cli.study.sections.results import Competitor
from mapmore_cli.study.tree import Loc
from mapmore_cli.study.units import default_unit, is_same

if TYPE_CHECKING:
    from mapmore_cli.modelling.literature import Formula


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
    # faults of a formula that the spec itself defines are reported at its definition
    if name is not None and name not in spec.own_formulas:
        known = (*literature.names(), *spec.own_formulas, *others)
        yield Finding(loc, f"there is no literature model `{name}`", did_you_mean(name, known))


def rivals_of(spec: ExperimentSpec) -> list[tuple[Loc, Competitor]]:
    """Return each competitor with its path in the spec. If the spec gives only a name, the
    competitor is the model with this name.
    """
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
    predicted = (None if is_own else spec.validation.as_) or spec.target_quantity
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
        *(
            (
                not is_same(default_unit(bound, spec.units), default_unit(bound)),
                loc,
                f"`{{name}}` contains numbers that hold only for the {bound} "
                f"{_in_words(default_unit(bound))}, but `units` sets another unit for it",
                f"remove `{bound}` from `units`, or leave `{{name}}` out",
            )
            for bound in formula.constants_for
        ),
        (
            predicted in formula.inputs,
            loc,
            "`{name}` needs `{predicted}` as an input, but `{predicted}` is to be predicted here",
            "leave `{name}` out, or set `target` to the quantity that `{name}` gives",
        ),
        (of_cycles and is_own, loc, "`{name}` is fitted to load cycles, not to a target", beside),
        (
            of_cycles and not is_own and (spec.needs.static is None or spec.target not in MOTION),
            loc,
            "`{name}` is fitted to the load cycles of a static run, and this spec names none",
            STATIC_RUN,
        ),
        (
            of_cycles and not is_own and muscle.length is None,
            loc,
            "`{name}` needs the length of the muscle",
            "add `length: 88 mm` (with your own number) to `muscle`",
        ),
        name=name,
        predicted=predicted,
    )


def _in_words(unit: str) -> str:
    return "as a fraction" if unit == "1" else f"in {unit}"


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
    """Check each competitor: the starting values of its parameters must suit its formula, its name
    must be unique, and the data to which it is fitted must exist.
    """
    shown, moves = [OWN, REPEATABILITY], spec.target in MOTION
    for loc, rival in rivals_of(spec):
        formula, composite = formula_called(spec, rival.model), rival.static is not None
        at_levels = rival.levels is not None
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
                "the static part is fitted to the data of a static run, and this spec names none",
                STATIC_RUN,
            ),
            (
                rival.label in shown,
                loc,
                "two models in the table of scores have the name `{label}`",
                "give this one a name: `{{model: ..., as: NAME}}`",
            ),
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
            target=spec.target,
            label=rival.label,
            model=rival.model,
        )
        shown.append(rival.label)


def own_formulas(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check each formula that the spec defines: its name must not be in use, its expression must be
    valid, and it must be linear in every parameter that has no bounds.
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
