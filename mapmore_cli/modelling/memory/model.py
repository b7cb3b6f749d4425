"""Predict recordings with a model with memory, and return its training range, its equations and its
program.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, row_by_row, row_count
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.fits import PIECE, FormulaFit, MemoryModel
from mapmore_cli.domain.models import Equation, Memory, Model
from mapmore_cli.domain.recording import CurveRange, Quantity, united
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.equations import RECURSIVE, TOLERANCE, equation
from mapmore_cli.modelling.expressions import (
    Expression,
    NotFinite,
    Number,
    dictionary_matrix,
    parse,
    state,
    substitute,
)
from mapmore_cli.modelling.expressions.states import Measured
from mapmore_cli.modelling.expressions.syntax import ONE, ZERO, Condition
from mapmore_cli.modelling.kinds import Verbs
from mapmore_cli.modelling.literature.model import (
    backbone_values,
    formula_equations,
    formula_value,
    where_finite,
)
from mapmore_cli.modelling.memory.feedback import StateWriter, fed_back_states, parts_of_terms
from mapmore_cli.modelling.memory.free_run import Along
from mapmore_cli.modelling.memory.records import numbered
from mapmore_cli.modelling.memory.simulation import divergence_bounds
from mapmore_cli.modelling.memory.states import evaluate_states, memory_inputs
from mapmore_cli.modelling.program.statements import NOTHING, Queue
from mapmore_cli.modelling.program.writing import Inputs, Writer, limit, product_as_written, total


def memory_model(
    name: str,
    memory: MemoryModel,
    backbone: FormulaFit | None,
    training: Sequence[CurveRange],
    quantities: Mapping[str, Quantity],
    notes: tuple[str, ...] = (),
) -> Model:
    """Return a model with memory, together with the backbone to whose residual it was fitted. The
    range of its inputs is that of the `training` curves.
    """
    formula = () if backbone is None else literature.of(backbone).inputs
    inputs = sorted({*memory_inputs(memory), *formula})
    ranges = tuple(curve.of(inputs) for curve in training)
    return Model(
        name,
        quantities[memory.output],
        tuple(quantities[name] for name in inputs),
        Memory(memory, ranges, backbone),
        notes=notes,
    )


def outliers_fed_back(model: Model, loss: str) -> list[str]:
    """Return a note if a robust loss does not protect the model from outliers, because past outputs
    are inputs of the model.
    """
    memory = model.body_of(Memory).model
    if loss == "squares" or not fed_back_states(memory.states, memory.output):
        return []
    return [
        (
            f"`fit.loss: {loss}` gives a wrong value of {memory.output} less weight, but not the "
            "later samples that have this value as their past output, so that one gross outlier "
            "can still change the model"
        )
    ]


def _base(model: Model, columns: Columns) -> Array:
    body = model.body_of(Memory)
    if body.backbone is None:
        return np.zeros(row_count(columns))
    return where_finite(
        model.inputs, columns, lambda inputs, n: backbone_values(body.backbone, inputs, n)
    )


def _written(m: Writer, model: MemoryModel, inputs: Inputs) -> Expression:
    """Write the statements that compute the output at a sample in free run, and return the name of
    the output. The output is NaN at the first samples, and after the run has diverged.
    """
    seen = m.number("seen")
    writer = StateWriter(m, model.states, model.output, inputs, seen)
    names = {name: writer.scaled(name) for name in model.states.names}
    lags = fed_back_states(model.states, model.output)
    early = seen < float(max((state(name).lag for name in model.states.names), default=0))

    def bounded() -> Expression:
        """Write the statements that compute the output. From the sample at which the output leaves
        the bounds, it is NaN until the program is reset.
        """
        value, (low, high) = _sum_of_terms(m, model, names), divergence_bounds(model.limits)
        lost_now = [(lost > 0, NOTHING), (value < low, NOTHING), (value > high, NOTHING)]
        return m.choose("within", lost_now, value)

    if lags:
        lost = m.number("lost")
        output = m.choose("memory", [(early, NOTHING)], bounded)
        finite = Condition(output, "==", output)
        m.keep(lost, m.choose("lost", [(early, ZERO), (finite, ZERO)], ONE))
        queue = writer.queues[Measured(model.output)]
        m.kept.fed_back.setdefault(model.output, []).append(queue)
    else:
        output = m.choose("memory", [(early, NOTHING)], lambda: _sum_of_terms(m, model, names))
    m.statements += [Queue(queue, value) for queue, value in writer.pushed(output).items()]
    m.keep(seen, seen + 1)
    return output


def _sum_of_terms(m: Writer, model: MemoryModel, names: Mapping[str, Expression]) -> Expression:
    """Write the statements that compute `constant + sum_j theta_j D_j`, in which `D_j` is term j
    and `theta_j` is its coefficient. Terms without fed-back states are added up first, because a
    free run (`simulation`) adds them up first too.
    """
    parts = parts_of_terms(model.terms, fed_back_states(model.states, model.output))
    sums: dict[int, list[Expression]] = {group: [] for group in range(len(parts.owns))}
    sums[-1] = [Number(model.constant)]
    for inputs, theta, group in zip(
        parts.inputs, model.theta.tolist(), parts.groups.tolist(), strict=True
    ):
        driven = m.let("driven", substitute(inputs, names))
        sums[group].append(product_as_written(Number(theta), driven))
    base = m.let("base", total(sums.pop(-1)))
    return parts.summed(
        m, base, [m.let("weight", total(weights)) for weights in sums.values()], names
    )


class MemoryVerbs(Verbs):
    """Operations of a model with memory."""

    def running(self, model: Model, ahead: bool = False) -> Callable[[Columns], SimulatedRun]:
        """Return a function that predicts the next rows of a recording each time it is called: in
        free run, or one step ahead if `ahead` is true. The backbone is included.
        """
        along = Along(model.body_of(Memory).model, ahead)

        def next_rows(columns: Columns) -> SimulatedRun:
            run = along(columns)
            return SimulatedRun(_base(model, columns) + run.values, run.diverged)

        return next_rows

    def simulate(self, model: Model, columns: Columns, ahead: bool = False) -> SimulatedRun:
        """Return the free run of the model along one recording, shape (n,), or, with `ahead`, its
        one-step-ahead predictions.
        """
        next_rows = self.running(model, ahead)
        diverged = list[int]()
        rows = 0

        def values(block: Columns) -> Array:
            nonlocal rows
            numbers = np.arange(rows, rows + row_count(block))
            with numbered(numbers):
                run = next_rows(block)
            diverged.extend(numbers[list(run.diverged)].tolist())
            rows += len(numbers)
            return run.values

        return SimulatedRun(row_by_row(values, columns), tuple(diverged))

    def one_step(self, model: Model, columns: Columns) -> Array:
        """Return the one-step-ahead prediction of every row, from measured outputs, shape (n,); NaN
        at the first rows.
        """
        return self.simulate(model, columns, ahead=True).values

    def settled(self, model: Model, columns: Columns) -> Array:
        """Return the output at rest for constant inputs, shape (n,). If the output is fed back, its
        value at rest is found by Steffensen's method.

        The coefficients of the model have the shape (k,), or (k, n) if they differ between the rows
        of `columns`. Raises FitError if the output does not come to rest.
        """
        from scipy.optimize import fixed_point

        memory = model.body_of(Memory).model
        base = _base(model, columns)
        terms = list(map(parse, memory.terms))
        start = np.full(len(base), memory.limits[1])

        def following(y: Array) -> Array:
            """Return the output at the next sample if all earlier outputs were y."""
            states = evaluate_states(memory.states, {**columns, memory.output: y}, still=True)
            parts = dictionary_matrix(terms, states, len(y)) * memory.theta.T
            return np.asarray(parts.sum(axis=1) + memory.constant)

        with suppress(NotFinite, RuntimeError), np.errstate(all="ignore"):
            rest = fixed_point(following, start) if self.fed_back(model) else following(start)
            if (np.clip(rest, *divergence_bounds(memory.limits)) == rest).all():
                return base + rest
        raise FitError(
            "fit.shape: with constant inputs, the output of the fitted model does not settle, so "
            "that its shape at rest cannot be checked",
            "use fewer delays of the output, or remove `fit.shape`",
        )

    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return the equation of the backbone, followed by the equation of the output at the next
        sample.
        """
        body = model.body_of(Memory)
        memory = body.model
        limits = united(
            [
                *(curve_range.limits for curve_range in body.ranges),
                {body.model.output: body.model.limits},
            ]
        )
        return *formula_equations(body.backbone, units), equation(
            PIECE,
            memory.terms,
            memory.theta,
            memory.scaling,
            limits,
            units,
            tolerance=RECURSIVE if self.fed_back(model) else TOLERANCE,
        )

    def rules(self, model: Model) -> Iterator[str]:
        """Yield sentences that say how the output is computed along a recording."""
        body = model.body_of(Memory)
        memory = body.model
        if body.backbone is not None:
            yield f"{model.output.name} is {body.backbone.name} plus terms with memory."
        most = max(fed_back_states(memory.states, memory.output).values(), default=0)
        first = f"the first {most} measured samples" if most > 1 else "the first measured sample"
        start = f"from {first} of {memory.output}" if most else f"without measured {memory.output}"
        steps = f"with steps of {memory.states.step:.6g} s"
        if memory.states.ordered:
            steps = "sample by sample, whatever the time between them"
        yield f"It runs free {start}, {steps}."

    def parameters(self, model: Model) -> int:
        """Return the number of parameters. They are the coefficients of the terms, the constant of
        the model if it has one, and the parameters of the backbone.
        """
        body = model.body_of(Memory)
        coefficients = len(body.model.theta) + (body.model.constant != 0.0)
        return coefficients + (0 if body.backbone is None else len(body.backbone.parameters))

    def fed_back(self, model: Model) -> tuple[str, ...]:
        """Return a tuple with the name of the output if the output is fed back; otherwise, an empty
        tuple.
        """
        memory = model.body_of(Memory).model
        return (memory.output,) if fed_back_states(memory.states, memory.output) else ()

    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:
        """Write a model with memory and its backbone as statements of a program."""
        body = model.body_of(Memory)
        limit(m, body.ranges, None, inputs)
        m.kept.steps.append(body.model.states.step)
        return m.let(
            "model", formula_value(m, body.backbone, inputs) + _written(m, body.model, inputs)
        )

    def faults(self, model: Model) -> Iterator[str]:
        """Yield a sentence if a stored model is inconsistent: its output is not the output of the
        memory, or a term contains a state that the model does not have.
        """
        memory = model.body_of(Memory).model
        if memory.output != model.output.name or not all(
            parse(text).names <= {*memory.states.names} for text in memory.terms
        ):
            yield "its terms use states that it does not have"
