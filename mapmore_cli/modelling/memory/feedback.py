"""What a free run needs of a model, taken apart beforehand: terms as products of a part of inputs
and a part of fed-back states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import StateSet
from mapmore_cli.modelling.expressions import (
    Expression,
    Name,
    compiled,
    derivative,
    multiply,
    parse,
    to_text,
)
from mapmore_cli.modelling.expressions.operator import Recursion
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Lagged, Measured, Operated, State, state
from mapmore_cli.modelling.expressions.syntax import ONE, Power, Product
from mapmore_cli.modelling.memory.states import setting_of

Own = Callable[
    [Sequence[float]], float
]  # the part of a term that depends on fed-back states, as a function of their values at one sample
OUTPUT = -1  # place of the output itself, where others are places of nodes


@dataclass(frozen=True)
class Node:
    """A state that depends on the output: some samples ago (`steps`), or by a `rule` of an
    operator; `source` is a node or `OUTPUT`.
    """

    state: State
    source: int
    steps: int = 0
    rule: Recursion | None = None


class Feedback:
    """A model's terms taken apart, `D_j = own_j(fed-back states) * input_j(states of inputs
    alone)`.

    - `names`: the m fed-back states; `nodes`: they and all that they are made of, sources first;
      `places`: (m) theirs among these.
    - `inputs`: (k) input parts; `owns`: the G different parts of fed-back states; `groups`: (k)
      which of them is a term's, -1 for none.
    - `longest`: measured outputs that a run begins with; `depth`: past values that the next sample
      may need, of the output and of any node.
    - `limits`: lower end and width of the scale of each fed-back state; an infinite width, and so
      zero, where it stood still in training.

    Raises DataError for a state or a term that cannot be fed back.
    """

    def __init__(self, terms: Sequence[str], states: StateSet, output: str) -> None:
        self.states, self.output = states, output
        lags = fed_back_states(states, output)
        self.names = tuple(lags)
        parts = [parted(parse(text), lags) for text in terms]
        self.inputs = [inputs for _, inputs in parts]
        self.owns = list(dict.fromkeys(own for own, _ in parts if own != ONE))
        self.groups = np.array(
            [self.owns.index(own) if own != ONE else -1 for own, _ in parts], dtype=np.int64
        )
        found = dict.fromkeys(
            part
            for name in self.names
            for part in state(name).parts
            if not isinstance(part, Measured)
        )
        order: dict[State, int] = {part: place for place, part in enumerate(found)}
        self.nodes = [_node(part, order, states) for part in found]
        self.places = [order[state(name)] for name in self.names]
        self.longest = max(lags.values(), default=0)
        self.depth = (
            self.longest
            + max(
                (max(node.rule.own, node.rule.source) for node in self.nodes if node.rule),
                default=0,
            )
            + 1
        )
        scales = zip(states.names, states.low.tolist(), states.high.tolist(), strict=states.scaled)
        self.limits = [
            (low, high - low if high > low else math.inf)
            for name, low, high in scales
            if name in lags
        ]

    @property
    def only_delays(self) -> bool:
        """Whether the output is fed back by delays alone, and by no operator."""
        return all(node.source == OUTPUT and node.rule is None for node in self.nodes)

    @cached_property
    def slopes(self) -> list[tuple[str, int, Expression]]:
        """Derivatives of the parts of fed-back states that are not zero: by which state, of which
        part.
        """
        return [
            (name, place, derivative(own, name))
            for place, own in enumerate(self.owns)
            for name in self.names
            if name in own.names
        ]

    @cached_property
    def functions(self) -> list[Own]:
        """The parts of fed-back states as functions."""
        places = {name: place for place, name in enumerate(self.names)}
        return [_own(own, places) for own in self.owns]


def _node(part: Lagged | Operated, places: Mapping[State, int], states: StateSet) -> Node:
    source = places.get(part.source, OUTPUT)
    if isinstance(part, Lagged):
        return Node(part, source, part.steps)
    return Node(part, source, rule=OPERATORS[part.operator].recursion(setting_of(part, states)))


def fed_back_states(states: StateSet, output: str) -> dict[str, int]:
    """Return the states that depend on the output, with how many samples they look back at least.

    Raises DataError for a state of the output as it is now: a model cannot explain its output by
    itself.
    """
    found: dict[str, int] = {}
    for name in states.names:
        one = state(name)
        if one.quantity != output:
            continue
        if not looks_back(one):
            raise DataError(
                f"the state `{name}` depends on the output {output} as it is now",
                f"let it look back: operators of the output work on {output}[k-1]",
            )
        found[name] = one.lag
    return found


def looks_back(found: State) -> bool:
    """Whether the quantity that a state is made of enters it delayed: `stop(force[k-1], 0.1)` does,
    `stop(force, 0.1)[k-1]` does not.
    """
    return any(isinstance(part, Lagged) for part in found.parts[1:2])


def parted(term: Expression, fed_back: Container[str]) -> tuple[Expression, Expression]:
    """Return a term as (part of fed-back states) times (part of inputs).

    Raises DataError where one factor has both: its value at every sample could not be prepared.
    """
    fed: list[Expression] = []
    inputs: list[Expression] = []
    for factor in term.factors if isinstance(term, Product) else (term,):
        own = [name for name in factor.names if name in fed_back]
        if own and len(own) < len(factor.names):
            raise DataError(
                f"the term `{to_text(term)}` has delayed outputs and inputs in one factor, "
                f"`{to_text(factor)}`",
                "write it as a product of a part with delayed outputs and a part with inputs",
            )
        (fed if own else inputs).append(factor)
    return multiply(*fed), multiply(*inputs)


def _own(expression: Expression, places: Mapping[str, int]) -> Own:
    """`expression` of fed-back states as a function of their list; products of few, the usual case,
    are the quickest.

    Values that are not finite come out as such.
    """
    match _monomial(expression, places):
        case [i]:
            return lambda y: y[i]
        case [i, j]:
            return lambda y: y[i] * y[j]
        case [i, j, *rest]:
            return lambda y: math.prod([y[place] for place in rest], start=y[i] * y[j])
    program, names = compiled((expression,)), sorted(expression.names)
    return lambda y: float(next(program({name: np.float64(y[places[name]]) for name in names})))


def _monomial(expression: Expression, places: Mapping[str, int]) -> list[int]:
    """Places of the factors of a product of powers of states, each as often as it stands; empty for
    anything else.
    """
    match expression:
        case Name(name):
            return [places[name]]
        case Power(Name(name), exponent) if exponent > 0 and exponent.is_integer():
            return [places[name]] * int(exponent)
        case Product(factors):
            each = [_monomial(factor, places) for factor in factors]
            return [place for one in each for place in one] if all(each) else []
    return []
