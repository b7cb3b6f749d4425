"""Fit the formulas of a sum together. An example is a pair of muscles that pull against each other,
if only the difference of their forces is measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain.arrays import Array, Columns, row_count
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling import kinds, literature
from mapmore_cli.modelling.expressions import (
    Name,
    Number,
    add,
    evaluate,
    multiply,
    parse,
    substitute,
    to_text,
)
from mapmore_cli.modelling.literature.formula import Formula, LinearForm
from mapmore_cli.study.sections.model import Summand


def sum_of(
    name: str, parts: Sequence[Part], output: Quantity, quantities: Mapping[str, Quantity]
) -> Model:
    """Return the model `output = sum_m sign_m m(inputs_m)`. The inputs of the sum are all
    quantities in the expressions from which the inputs of its parts are computed.

    Raises SpecError if an output is not in the unit of the sum, or if an input is not among the
    `quantities` with its unit.
    """
    used: set[str] = set()
    for part in parts:
        model = part.model
        if model.output.unit != output.unit:
            raise SpecError(
                f"needs: the model of {model.name} predicts in {model.output.unit}, but the "
                f"{output.name} of this study is in {output.unit}",
                "add up models with the same unit",
            )
        for quantity in model.inputs:
            source = parse(part.inputs.get(quantity.name, quantity.name))
            used |= source.names
            other = quantities.get(source.name) if isinstance(source, Name) else None
            if quantity.name not in part.inputs and other != quantity:
                raise SpecError(
                    f"needs: the model of {model.name} needs {quantity.name} in "
                    f"{quantity.unit}, which this study lacks",
                    "declare its column, derive it, or set its unit under `units`",
                )
            if other is not None and other.unit != quantity.unit:
                raise SpecError(
                    f"the sum: the model of {model.name} needs {quantity.name} in {quantity.unit}, "
                    f"but {other.name} of this study is in {other.unit}",
                    f"set the unit of {other.name} under `units`",
                )
    notes = tuple(f"{part.model.name}: {note}" for part in parts for note in part.model.notes)
    return Model(
        name,
        output,
        tuple(quantities[key] for key in sorted(used)),
        Sum(tuple(parts)),
        notes=notes,
    )


def actuator(force: Model, pressure: Model) -> Model:
    """Return the model of an actuator. It computes the force with the model `force`, whose pressure
    is the output of the model `pressure`. Therefore, an input of the actuator is the command of the
    valve instead of the pressure.

    Raises DataError in four cases: the force does not depend on the pressure, or uses it in another
    unit; the force depends on the rate of the pressure; the pressure model needs measured values of
    the pressure to start; both models have an input of the same name in different units.
    """
    output, needed = pressure.output, {quantity.name: quantity for quantity in force.inputs}
    if needed.pop(output.name, None) != output:
        problem = (
            f"{force.name} does not depend on {output.name} in {output.unit}, which "
            f"{pressure.name} predicts"
        )
        raise DataError(
            problem,
            f"fit {force.name} with this quantity as an input, and set its unit under `units`",
        )
    if rates := [signal.name for signal in force.signals if signal.of == output.name]:
        raise DataError(
            f"{force.name} needs {rates[0]}, which {pressure.name} does not predict",
            f"fit {force.name} without this rate",
        )
    if kinds.fed_back(pressure):
        raise DataError(
            f"{pressure.name} starts from measured values of {output.name}, but the model of an "
            "actuator must compute them",
            f"fit {pressure.name} without delayed outputs in its dictionary",
        )
    inputs = {quantity.name: quantity for quantity in pressure.inputs}
    if other := [name for name in inputs if needed.get(name, inputs[name]) != inputs[name]]:
        raise DataError(
            f"{force.name} and {pressure.name} have {other[0]} in different units",
            "give it the same unit under `units` in the specs of both models",
        )
    quantities = tuple({**inputs, **needed}.values())
    signals = tuple(dict.fromkeys((*pressure.signals, *force.signals)))
    notes = tuple(
        f"{formula.name}: {note}" for formula in (force, pressure) for note in formula.notes
    )
    return Model(
        f"{force.name}-actuator",
        force.output,
        quantities,
        Sum((Part(force, fed=(Part(pressure),)),)),
        signals,
        notes,
    )


def refuse_shared_names(inputs_of: Sequence[tuple[str, Sequence[str], Mapping[str, str]]]) -> None:
    """Raise SpecError if two parts of a sum have an input of the same name that the spec does not
    rename. The two inputs may be different quantities, for example the pressures of two muscles.

    `inputs_of` holds for every part its name, its own inputs, and their renaming.
    """
    for (first, names, of_one), (second, others, of_other) in combinations(inputs_of, 2):
        if shared := [
            name for name in names if name in others and not (name in of_one and name in of_other)
        ]:
            name = shared[0]
            remedy = (
                f"give each its own quantity: `inputs: {{{name}: {name}_1}}` and `inputs: "
                f"{{{name}: {name}_2}}`"
            )
            same_input = f"if it is the same quantity, write `inputs: {{{name}: {name}}}` for both"
            raise SpecError(
                f"{first} and {second} both have an input called `{name}`; it may be a "
                "different quantity in each",
                f"{remedy}; {same_input}",
            )


def own_inputs(part: Summand, columns: Columns) -> Columns:
    """Return the inputs of a formula in a sum, (n,) each, by the names that the formula itself
    uses. The `columns` have the names of the sum.
    """
    n, names = row_count(columns), literature.get(str(part.formula)).inputs
    return {name: evaluate(parse(part.inputs.get(name, name)), columns, n) for name in names}


def fit_jointly(
    summands: Sequence[Summand], columns: Columns, y: Array, method: str | None = None
) -> FormulaFit:
    """Fit `sum_i sign_i f_i` to `y`, (n,), by least squares over all parameters at once.

    The parameter `F` of the second summand has the name `F_2`. If the sum does not determine some
    parameters separately, for example a constant in each of two summands, the rank is deficient,
    and the notes name these parameters.

    Raises SpecError for a formula with its own method of fitting, or one that needs a dimension of
    the muscle; DataError like `Formula.fit`.
    """
    inputs = {
        f"{name}_{i}": x
        for i, summand in enumerate(summands, 1)
        for name, x in own_inputs(summand, columns).items()
    }
    return joint_formula(summands).fit(inputs, y, method)


def joint_formula(summands: Sequence[Summand]) -> Formula:
    """Return the sum as one formula. The number of a summand, such as `_2`, is appended to the
    names of its inputs and parameters.
    """
    parts = [
        _numbered(literature.get(str(summand.formula)), i) for i, summand in enumerate(summands, 1)
    ]
    own_forms = [part.form or LinearForm(part.text, part.linear, {}) for part in parts]
    signs = [float(summand.sign) for summand in summands]
    form = LinearForm(
        _sum(signs, [part.text for part in own_forms]),
        tuple(name for part in own_forms for name in part.linear),
        {name: text for part in own_forms for name, text in part.printed.items()},
    )
    names = [
        f"{'-' if sign < 0 else '+'} {part.name}" for sign, part in zip(signs, parts, strict=True)
    ]
    return Formula(
        name=" ".join(names).removeprefix("+ "),
        reference="; ".join(dict.fromkeys(part.reference for part in parts)),
        inputs=tuple(name for part in parts for name in part.inputs),
        parameters=tuple(name for part in parts for name in part.parameters),
        text=_sum(signs, [part.text for part in parts]),
        nonlinear=tuple(parameter for part in parts for parameter in part.nonlinear),
        form=form if any(part.form for part in parts) else None,
    )


def _numbered(formula: Formula, number: int) -> Formula:
    """Return a formula with `_number` appended to the names of its inputs and parameters. Raises
    SpecError if the formula cannot be fitted together with others.
    """
    if type(formula) is not Formula or formula.dimensions:
        raise SpecError(
            f"{formula.name} cannot be fitted together with other formulas in a sum",
            "use another formula, or fit it in a run of its own, and name its spec as `model`",
        )

    def numbered(name: str | None) -> str:
        return f"{name}_{number}"

    def renamed(text: str) -> str:
        expression = parse(text)
        return to_text(
            substitute(expression, {name: Name(numbered(name)) for name in expression.names})
        )

    form = formula.form
    return replace(
        formula,
        inputs=tuple(map(numbered, formula.inputs)),
        parameters=tuple(map(numbered, formula.parameters)),
        text=renamed(formula.text),
        nonlinear=tuple(
            replace(
                parameter,
                name=numbered(parameter.name),
                per=parameter.per and numbered(parameter.per),
                of=parameter.of and numbered(parameter.of),
            )
            for parameter in formula.nonlinear
        ),
        form=form
        and LinearForm(
            renamed(form.text),
            tuple(map(numbered, form.linear)),
            {numbered(name): renamed(text) for name, text in form.printed.items()},
        ),
    )


def _sum(signs: Sequence[float], texts: Sequence[str]) -> str:
    terms = zip(map(Number, signs), map(parse, texts), strict=True)
    return to_text(add(*(multiply(sign, term) for sign, term in terms)))


def split(fit: FormulaFit, summands: Sequence[Summand]) -> list[FormulaFit]:
    """Return the fit of each summand, taken from the fit of the whole sum. Its parameters have the
    names of the formula again, without the number of the summand.
    """
    parts = []
    for i, summand in enumerate(summands, 1):
        formula = literature.get(str(summand.formula))
        parameters, errors = (
            {name: numbers[f"{name}_{i}"] for name in formula.parameters}
            for numbers in (fit.parameters, fit.errors)
        )
        named = replace(fit, name=formula.name, definition=formula.definition)
        parts.append(replace(named, parameters=parameters, errors=errors))
    return parts
