"""Write the statements that compute one sample of a model with memory: its states, and the sum of
its terms.

A term `D_j = own_j input_j` is a product of two factors. The factor `own_j` depends on fed-back
states, and the factor `input_j` depends on inputs. Exported programs compute both factors at each
sample. Training and prediction compute the factor of the inputs for all samples in advance.
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

    - `seen`: variable that holds the number of samples before the present sample. With it, the
      program recognises the first samples, at which past values do not exist yet. It is None if all
      past values are known.
    - `queues`: for each state whose past values are needed, the name of the queue that holds them.
    - `rules`: if all past values are known, each operator and each scaling becomes a function of
      the program; `rules` holds its rule by the name of this function.
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
        """Write the statements that compute the scaled value of a state, and return the expression
        of this value. Terms use scaled values. `states.evaluate_states` computes the same value for
        whole columns.
        """
        states = self.states
        value = self.value(state(name))
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
        """Write the statements that compute a state in physical units, and return the expression of
        its value.
        """
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
        """Return, for each queue of past values, the value at the present sample, which is appended
        to the queue.
        """
        known = {**self.known, Measured(self.output): output}
        return {queue: known[source] for source, queue in self.queues.items()}

    def _recalled(self, source: State, steps: int) -> Expression:
        if isinstance(source, Lagged):
            return self._recalled(source.source, steps + source.steps)
        if source not in self.queues:
            self.queues[source] = self.m.fresh("queue")
        queue = self.queues[source]
        sizes = self.m.kept.queues
        if (queue, steps) not in self.recalls:
            sizes[queue] = max(sizes.get(queue, 0), steps)
            self.recalls[queue, steps] = Recall(self.m.fresh("past"), queue, steps)
            self.m.statements.append(self.recalls[queue, steps])
        return Name(self.recalls[queue, steps].name)

    def _operated(self, operated: Operated) -> Expression:
        """Write the statements that compute the state of an operator from past values. Up to the
        first sample at which the source has a value, the state is at rest.
        """
        m = self.m
        rule = OPERATORS[operated.operator].recursion(setting_of(operated, self.states))
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
        """Write the statements that apply a rule to the given values, and return the expression of
        the result. If all past values are known (`seen` is None), the rule is written as a function
        of the program, and this function is called.
        """
        m = self.m
        if self.seen is not None:
            return m.let(stem, rule(m, *values))
        function = m.fresh(stem)
        names = [m.fresh("argument") for _ in values]
        self.rules[function] = rule
        m.function(function, names, lambda: rule(m, *map(Name, names)), "")
        return m.use(stem, function, values)

    def _past(self, of_state: State, count: int) -> list[Expression]:
        """Write statements that read the last `count` values of a state, and return their
        expressions. Values before the first sample are equal to the value at the first sample.
        """
        past: list[Expression] = []
        for steps in range(1, count + 1):
            value = self._recalled(of_state, steps)
            if self.seen is not None and past:
                value = self.m.where(self.seen < of_state.lag + steps, past[-1], value)
            past.append(value)
        return past


class SplitTerms(NamedTuple):
    """The k terms of a model, each split into a factor of inputs and a factor of fed-back states.
    `inputs` holds the factor of inputs of each term. `owns` holds the G different factors of
    fed-back states. `groups`, (k,), holds the index of each term in `owns`, or -1 for a term
    without fed-back states.
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
        """Write the statements that compute the output `base + sum_g weights[g] owns[g]`, and
        return the name of the output. `base` is the sum of the terms without fed-back states.
        `names` holds, for the name of each state, the expression that replaces it.
        """
        fed = [
            product_as_written(weight, m.let("own", substitute(part, names)))
            for part, weight in zip(self.owns, weights, strict=True)
        ]
        return m.let("output", total([base, *fed]))


def parts_of_terms(terms: Sequence[str], fed_back: Container[str]) -> SplitTerms:
    """Split terms into factors of inputs and factors of fed-back states. Raises DataError if a
    factor contains both inputs and fed-back states.
    """
    both = [parted(parse(text), fed_back) for text in terms]
    owns = list(dict.fromkeys(part for part, _ in both if part != ONE))
    groups = np.array([-1 if part == ONE else owns.index(part) for part, _ in both], dtype=np.int64)
    return SplitTerms([inputs for _, inputs in both], owns, groups)


class Feedback:
    """Computation that a free run repeats at every sample. It computes the output and the fed-back
    states from past values.

    - `queues`: the q states whose past values must be stored, the output first.
    - `recalls`: for each name of a past value, its queue, and the number of samples by which the
      value lies in the past.
    - `longest`: number of measured outputs that a run needs before its first prediction.
    - `depth`: number of past values that the next sample may need.

    Raises DataError for a state or a term that cannot be fed back.
    """

    def __init__(self, terms: Sequence[str], states: StateSet, output: str) -> None:
        self.states = states
        self.output = output
        lags = fed_back_states(states, output)
        self.names = tuple(lags)
        self.longest = max(lags.values(), default=0)
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
        self.block = Block(computed, tuple(pushed.values()))
        self.functions = tuple(m.functions.values())
        self.rules = writer.rules

    @cached_property
    def step(self) -> Run:
        """Function that returns the q values that are appended to the `queues` at a sample; the
        first is the output. Its arguments are past values, `base` (the sum of the terms without
        fed-back states), and the weights of the factors of fed-back states.
        """
        return ready_for_one_sample(self.block, self.rules)

    @cached_property
    def slopes(self) -> Run:
        """Function that returns the derivatives of the q values with respect to every past value
        and every weight, for all samples of a run.
        """
        names = [*self.recalls, *self.weights]
        return ready_for_columns(
            with_slopes_by(self.block, names), functions_with_slopes(self.functions)
        )


def fed_back_states(states: StateSet, output: str) -> dict[str, int]:
    """Return the states that depend on the output, each with its delay in samples.

    Raises DataError if a state depends on the output at the present sample, because this is the
    value to be predicted.
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
    """Return True if a state contains its measured quantity with a delay, as `stop(force[k-1],
    0.1)` does. In `stop(force, 0.1)[k-1]`, only the result is delayed, so the function returns
    False.
    """
    return any(isinstance(part, Lagged) for part in of_state.parts[1:2])


def parted(term: Expression, fed_back: Container[str]) -> tuple[Expression, Expression]:
    """Split a term into a factor of fed-back states and a factor of inputs.

    Raises DataError if a factor, for example a function, contains both, because its values cannot
    be computed in advance.
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
