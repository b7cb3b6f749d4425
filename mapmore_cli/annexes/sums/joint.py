"""Formulas that are added up and fitted together: the muscles of a pair pull against each other,
and only their difference is measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling import kinds, literature
from mapmore_cli.modelling.expressions import (
    Expression,
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


def sum_of(
    name: str, parts: Sequence[Part], output: Quantity, quantities: Mapping[str, Quantity]
) -> Model:
    """Return the model `output = sum_m sign_m m(inputs_m)`, a function of every quantity that its
    parts' inputs are made of.

    Raises SpecError where an output is not in the unit of the sum, or an input is not among the
    `quantities` in its unit.
    """
    used: set[str] = set()
    for part in parts:
        model = part.model
        if model.output.unit != output.unit:
            what = (
                f"needs: the model of {model.name} is in {model.output.unit}, the "
                f"{output.name} of this study in {output.unit}"
            )
            raise SpecError(what, "add up models of one unit")
        for quantity in model.inputs:
            source = parse(part.inputs.get(quantity.name, quantity.name))
            used |= source.names
            other = quantities.get(source.name) if isinstance(source, Name) else None
            if quantity.name not in part.inputs:
                if other != quantity:
                    what = (
                        f"the model of {model.name} is a function of {quantity.name} in "
                        f"{quantity.unit}, which this study lacks"
                    )
                    raise SpecError(
                        f"needs: {what}",
                        "declare its column, derive it, or set its unit under `units`",
                    )
            elif missing := sorted(source.names - {*quantities}):
                raise SpecError(
                    f"the sum: there is no quantity {missing[0]} for {quantity.name} of "
                    f"{model.name}",
                    "declare its column",
                )
            elif other is not None and other.unit != quantity.unit:
                what = (
                    f"{quantity.name} of {model.name} is in {quantity.unit}, {other.name} in "
                    f"{other.unit}"
                )
                raise SpecError(f"the sum: {what}", f"set the unit of {other.name} under `units`")
    notes = tuple(f"{part.model.name}: {note}" for part in parts for note in part.model.notes)
    return Model(
        name, output, tuple(quantities[key] for key in sorted(used)), Sum(tuple(parts)), notes=notes
    )


def actuator(force: Model, pressure: Model) -> Model:
    """Return a model whose input `pressure` is the output of another: from what a valve is told to
    the force.

    Raises DataError where the force does not depend on the pressure, on its rate, or in another
    unit, where the pressure goes on from its measured past, and where both have an input of one
    name in two units.
    """
    output, needed = pressure.output, {quantity.name: quantity for quantity in force.inputs}
    if needed.pop(output.name, None) != output:
        found = (
            f"{force.name} is no function of {output.name} in {output.unit}, which "
            f"{pressure.name} predicts"
        )
        raise DataError(found, "fit it by that quantity, with the unit under `units`")
    if rates := [signal.name for signal in force.signals if signal.of == output.name]:
        raise DataError(
            f"{force.name} needs {rates[0]}, which {pressure.name} does not predict",
            "fit the force without it",
        )
    if kinds.fed_back(pressure):
        raise DataError(
            f"{pressure.name} goes on from measured {output.name}", "fit it without past outputs"
        )
    inputs = {quantity.name: quantity for quantity in pressure.inputs}
    if other := [name for name in inputs if needed.get(name, inputs[name]) != inputs[name]]:
        raise DataError(
            f"{force.name} and {pressure.name} have {other[0]} in different units",
            "set it under `units`",
        )
    given = tuple({**inputs, **needed}.values())
    signals = tuple(dict.fromkeys((*pressure.signals, *force.signals)))
    notes = tuple(f"{one.name}: {note}" for one in (force, pressure) for note in one.notes)
    return Model(
        f"{force.name}-actuator",
        force.output,
        given,
        Sum((Part(force, fed=(Part(pressure),)),)),
        signals,
        notes,
    )


def refuse_shared_names(inputs_of: Sequence[tuple[str, Sequence[str], Mapping[str, str]]]) -> None:
    """Raise `SpecError` where two parts of a sum have an input of one name of which nothing is
    said: two pressures are two quantities.

    `inputs_of` has for every part what it is called, its own inputs, and what is said of them.
    """
    for (first, names, said), (second, others, of_other) in combinations(inputs_of, 2):
        if shared := [
            name for name in names if name in others and not (name in said and name in of_other)
        ]:
            name = shared[0]
            remedy = (
                f"write what it is for each, as `inputs: {{{name}: {name}_1}}` and `inputs: "
                f"{{{name}: {name}_2}}`"
            )
            one = f"where it is one quantity, `inputs: {{{name}: {name}}}` for both"
            raise SpecError(f"{first} and {second} both have an input `{name}`", f"{remedy}; {one}")


@dataclass(frozen=True)
class Summand:
    """A formula in a sum: its `sign`, and expressions of the sum's inputs for inputs that have
    other names there.
    """

    formula: str
    sign: float = 1.0
    inputs: Mapping[str, str] = field(default_factory=dict)

    def own_inputs(self, columns: Columns) -> Columns:
        """Return the formula's inputs by its own names, `(n,)` each."""
        n = len(next(iter(columns.values())))
        names = literature.get(self.formula).inputs
        return {name: evaluate(parse(self.inputs.get(name, name)), columns, n) for name in names}


def fit_jointly(
    summands: Sequence[Summand], columns: Columns, y: Array, method: str | None = None
) -> FormulaFit:
    """Least squares of `y`, `(n,)`, by `sum_i sign_i f_i`, all parameters at once.

    A parameter `F` of the second summand is called `F_2`. Where the sum alone does not tell
    parameters apart, as the constants of both, the rank is deficient and the notes name them.

    Raises SpecError for a formula that is fitted in a way of its own, or needs a dimension of the
    muscle; DataError as `Formula.fit`.
    """
    formula = joint_formula(summands)
    inputs = {
        _numbered(name, i): x
        for i, one in enumerate(summands, 1)
        for name, x in one.own_inputs(columns).items()
    }
    return formula.fit(inputs, y, method)


def joint_formula(summands: Sequence[Summand]) -> Formula:
    """Return the sum as one formula, of the summands' inputs and parameters with their numbers
    behind their names.
    """
    parts = [_part(one) for one in summands]
    signs = [one.sign for one in summands]
    numbered = list(enumerate(parts, 1))
    forms = [
        part.form or LinearForm(part.text, (), {name: name for name in part.parameters})
        for part in parts
    ]
    form = None
    if any(part.form is not None for part in parts):
        linear = tuple(_numbered(name, i) for i, part in numbered for name in part.linear)
        texts = [
            (i, name, parse(text))
            for i, one in enumerate(forms, 1)
            for name, text in one.printed.items()
        ]
        printed = {_numbered(name, i): to_text(_renamed(text, i)) for i, name, text in texts}
        form = LinearForm(_sum((parse(one.text) for one in forms), signs), linear, printed)
    return Formula(
        name=" ".join(
            f"{'-' if sign < 0 else '+'} {part.name}"
            for sign, part in zip(signs, parts, strict=True)
        ).removeprefix("+ "),
        reference="; ".join(dict.fromkeys(part.reference for part in parts)),
        inputs=tuple(_numbered(name, i) for i, part in numbered for name in part.inputs),
        parameters=tuple(_numbered(name, i) for i, part in numbered for name in part.parameters),
        text=_sum([part.expression for part in parts], signs),
        nonlinear=tuple(
            replace(
                one,
                name=_numbered(one.name, i),
                per=one.per and _numbered(one.per, i),
                of=one.of and _numbered(one.of, i),
            )
            for i, part in numbered
            for one in part.nonlinear
        ),
        form=form,
    )


def split(fit: FormulaFit, summands: Sequence[Summand]) -> list[FormulaFit]:
    """Return the fit of each summand out of the joint one, with its parameters by their own
    names.
    """
    parts = []
    for i, one in enumerate(summands, 1):
        formula = literature.get(one.formula)
        values, errors = (
            {name: found[_numbered(name, i)] for name in formula.parameters}
            for found in (fit.parameters, fit.errors)
        )
        parts.append(
            replace(
                fit,
                name=formula.name,
                definition=formula.definition,
                parameters=values,
                errors=errors,
            )
        )
    return parts


def predict(fit: FormulaFit, summands: Sequence[Summand], columns: Columns) -> Array:
    """Return the sum at every row, `(n,)`; NaN with the parameters of a failed fit."""
    values = np.zeros(len(next(iter(columns.values()))))
    for one, part in zip(summands, split(fit, summands), strict=True):
        values += one.sign * literature.get(one.formula).predict(
            part.parameters, one.own_inputs(columns)
        )
    return values


def _part(summand: Summand) -> Formula:
    found = literature.get(summand.formula)
    if type(found) is not Formula or found.dimensions:
        raise SpecError(
            f"{found.name} cannot be fitted within a sum",
            "take another formula, or add up models of other runs",
        )
    return found


def _sum(expressions: Iterable[Expression], signs: Sequence[float]) -> str:
    terms = [
        multiply(Number(sign), _renamed(one, i))
        for i, (sign, one) in enumerate(zip(signs, expressions, strict=True), 1)
    ]
    return to_text(add(*terms))


def _renamed(expression: Expression, number: int) -> Expression:
    return substitute(
        expression, {name: Name(_numbered(name, number)) for name in expression.names}
    )


def _numbered(name: str, number: int) -> str:
    return f"{name}_{number}"
