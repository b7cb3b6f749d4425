"""Write the statements of one sample of a model with memory: its states, and the sum of its terms.

A term is a product of a factor of fed-back states and a factor of inputs, `D_j = own_j input_j`.
Programs write both factors. Training and prediction compute the factor of the inputs for all
samples at once.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import StateSet
from mapmore_cli.modelling.expressions import (
    Expression,
    Name,
    multiply,
    parse,
    substitute,
    to_text,
)
from mapmore_cli.modelling.expressions.operator import Amount, Arithmetic
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Lagged, Measured, Operated, State, state
from mapmore_cli.modelling.expressions.syntax import ONE, ZERO, Product
from mapmore_cli.modelling.memory.states import setting_of
from mapmore_cli.modelling.program.slopes import functions_with_slopes, with_slopes_by
from mapmore_cli.modelling.program.statements import Block, Recall
from mapmore_cli.modelling.program.values import Run, ready_for_columns, ready_for_one_sample
from mapmore_cli.modelling.program.writing import Inputs, Writer, product_as_written, total


class StateWriter:
    """Writer of statements that compute the states of one sample. Each state is written only once.

    - `seen`: number of samples before this one, by which operators recognise the first sample; None
      if all past values are known.
    - `queues`: for each state whose past values are needed, the name of the queue that holds them.
    - `rules`: if all past values are known, each operator becomes a function of the program;
      `rules` holds their recursions by the names of these functions.
    """

    def __init__(
        self, m: Writer, states: StateSet, output: str, inputs: Inputs, seen: Name | None = None
    ) -> None:
        self.m, self.states, self.output, self.inputs, self.seen = m, states, output, inputs, seen
        self.known: dict[State, Expression] = {}
        self.queues: dict[State, str] = {}
        self.recalls: dict[tuple[str, int], Recall] = {}
        self.rules: dict[str, Callable[..., Any]] = {}

    def scaled(self, name: str) -> Expression:
        """Write a state in the scaled form in which terms use it, as `states.evaluate_states`
        computes it.
        """
        states, value = self.states, self.value(state(name))
        if not states.scaled:
            return value
        place = states.names.index(name)
        low, high = float(states.low[place]), float(states.high[place])
        if not high > low:
            return ZERO

        def clipped(m: Arithmetic, x: Amount) -> Amount:
            return m.clip((x - low) / (high - low), -states.margin, 1 + states.margin)

        return self._next("scaled", clipped, [value])

    def value(self, wanted: State) -> Expression:
        """Write the statements that compute a state in physical units, and return its value."""
        if wanted not in self.known:
            match wanted:
                case Measured(name):
                    written = self.inputs[name]
                case Lagged(source, steps):
                    if source != Measured(self.output):
                        self.value(source)
                    written = self._recalled(source, steps)
                case Operated():
                    written = self._operated(wanted)
            self.known[wanted] = written
        return self.known[wanted]

    def pushed(self, output: Expression) -> dict[str, Expression]:
        """Return the value that this sample appends to each queue."""
        known = {**self.known, Measured(self.output): output}
        return {queue: known[source] for source, queue in self.queues.items()}

    def _recalled(self, source: State, steps: int) -> Expression:
        if isinstance(source, Lagged):
            return self._recalled(source.source, steps + source.steps)
        if source not in self.queues:
            self.queues[source] = self.m.fresh("queue")
        queue, sizes = self.queues[source], self.m.kept.queues
        if (queue, steps) not in self.recalls:
            sizes[queue] = max(sizes.get(queue, 0), steps)
            self.recalls[queue, steps] = Recall(self.m.fresh("past"), queue, steps)
            self.m.statements.append(self.recalls[queue, steps])
        return Name(self.recalls[queue, steps].name)

    def _operated(self, operated: Operated) -> Expression:
        """Write an operator in terms of past values. It is at rest up to the first sample at which
        its source has a value.
        """
        m, rule = self.m, OPERATORS[operated.operator].recursion(setting_of(operated, self.states))
        x = m.let("source", self.value(operated.source))
        own_past, past = self._past(operated, rule.own), self._past(operated.source, rule.source)
        if self.seen is None or not (own_past or past):
            return self._next(operated.operator, rule.next, [*own_past, x, *past])
        begins = self.seen <= operated.source.lag
        return m.choose(
            operated.operator, [(begins, rule.rest(x))], lambda: rule.next(m, *own_past, x, *past)
        )

    def _next(
        self, stem: str, rule: Callable[..., Any], values: Sequence[Expression]
    ) -> Expression:
        """Write a rule applied to some values, and return the result. If all past values are known
        (`seen` is None), the rule becomes a function of the program.
        """
        m = self.m
        if self.seen is not None:
            return m.let(stem, rule(m, *values))
        function, names = m.fresh(stem), [m.fresh("argument") for _ in values]
        self.rules[function] = rule
        m.function(function, names, lambda: rule(m, *map(Name, names)), "")
        return m.use(stem, function, values)

    def _past(self, of_state: State, count: int) -> list[Expression]:
        """Write the last values of a state. Before the first sample, the state had the value of the
        first sample.
        """
        past: list[Expression] = []
        for steps in range(1, count + 1):
            value = self._recalled(of_state, steps)
            if self.seen is not None and past:
                value = self.m.where(self.seen < of_state.lag + steps, past[-1], value)
            past.append(value)
        return past


class Parts(NamedTuple):
    """The k terms of a model. Each is a product of a factor of inputs and a factor of fed-back
    states. Stored are the factor of inputs of each term (k), the G different factors of fed-back
    states, and for each term (k) the index of its factor of fed-back states (-1 if it has none).
    """

    inputs: list[Expression]
    owns: list[Expression]
    groups: IntArray

    def summed(
        self,
        m: Writer,
        base: Expression,
        weights: Sequence[Expression],
        names: Mapping[str, Expression],
    ) -> Expression:
        """Write `base + sum_g weight_g own_g`; `names` gives the expressions of the states."""
        fed = [
            product_as_written(weight, m.let("own", substitute(part, names)))
            for part, weight in zip(self.owns, weights, strict=True)
        ]
        return m.let("output", total([base, *fed]))


def parts_of_terms(terms: Sequence[str], fed_back: Container[str]) -> Parts:
    """Return terms split into factors of inputs and of fed-back states. Raises DataError like
    `parted`.
    """
    both = [parted(parse(text), fed_back) for text in terms]
    owns = list(dict.fromkeys(part for part, _ in both if part != ONE))
    groups = np.array([-1 if part == ONE else owns.index(part) for part, _ in both], dtype=np.int64)
    return Parts([inputs for _, inputs in both], owns, groups)


class Feedback:
    """Computation that a free run repeats at every sample: from past values to the output and the
    fed-back states.

    - `queues`: the q states whose past values are needed, the output first.
    - `recalls`: for each name of a past value, the queue and the number of samples that the value
      lies back.
    - `longest`: number of measured outputs with which a run begins.
    - `depth`: number of past values that the next sample may need.

    Raises DataError for a state or a term that cannot be fed back.
    """

    def __init__(self, terms: Sequence[str], states: StateSet, output: str) -> None:
        self.states, self.output = states, output
        lags = fed_back_states(states, output)
        self.names, self.longest = tuple(lags), max(lags.values(), default=0)
        self.parts = parts_of_terms(terms, lags)
        self.weights = [f"weight_{group}" for group in range(len(self.parts.owns))]
        m = Writer()
        writer = StateWriter(m, states, output, {})
        writer.queues[Measured(output)] = m.fresh("queue")
        names = {name: writer.scaled(name) for name in lags}
        value = self.parts.summed(m, Name("base"), list(map(Name, self.weights)), names)
        pushed = writer.pushed(value)
        self.queues = list(writer.queues)
        places = {queue: place for place, queue in enumerate(pushed)}
        self.recalls = {
            recall.name: (places[recall.queue], recall.steps) for recall in writer.recalls.values()
        }
        self.depth = max((steps for _, steps in self.recalls.values()), default=0)
        computed = tuple(
            statement for statement in m.statements if not isinstance(statement, Recall)
        )
        self.block, self.functions = (
            Block(computed, tuple(pushed.values())),
            tuple(m.functions.values()),
        )
        self.rules = writer.rules

    @cached_property
    def step(self) -> Run:
        """Function that returns the q values at a sample. It takes past values, `base` (the sum of
        the terms without fed-back states), and the weights of the factors of fed-back states.
        """
        return ready_for_one_sample(self.block, self.rules)

    @cached_property
    def slopes(self) -> Run:
        """Function that returns the derivatives of the q values by every past value and every
        weight, along a run.
        """
        names = [*self.recalls, *self.weights]
        return ready_for_columns(
            with_slopes_by(self.block, names), functions_with_slopes(self.functions)
        )


def fed_back_states(states: StateSet, output: str) -> dict[str, int]:
    """Return the states that depend on the output, each with the smallest number of samples that it
    looks back.

    Raises DataError for a state of the output at the present sample, because a model cannot explain
    its output by itself.
    """
    lags: dict[str, int] = {}
    for name in states.names:
        part = state(name)
        if part.quantity != output:
            continue
        if not looks_back(part):
            raise DataError(
                f"the state `{name}` uses the present value of the output {output}",
                f"use the value one sample before: operators of the output need {output}[k-1]",
            )
        lags[name] = part.lag
    return lags


def looks_back(of_state: State) -> bool:
    """Return True if a state uses its measured quantity only with a delay: `stop(force[k-1], 0.1)`
    does, `stop(force, 0.1)[k-1]` does not.
    """
    return any(isinstance(part, Lagged) for part in of_state.parts[1:2])


def parted(term: Expression, fed_back: Container[str]) -> tuple[Expression, Expression]:
    """Return a term as a product (factor of fed-back states) times (factor of inputs).

    Raises DataError if one factor contains both, because its values could not be computed before
    the run.
    """
    fed: list[Expression] = []
    inputs: list[Expression] = []
    for factor in term.factors if isinstance(term, Product) else (term,):
        fed_names = [name for name in factor.names if name in fed_back]
        if fed_names and len(fed_names) < len(factor.names):
            raise DataError(
                f"in the term `{to_text(term)}`, the factor `{to_text(factor)}` mixes "
                "delayed outputs and inputs",
                "write the term as a product of one factor with delayed outputs and one "
                "factor with inputs",
            )
        (fed if fed_names else inputs).append(factor)
    return multiply(*fed), multiply(*inputs)
