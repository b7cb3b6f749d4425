"""What a free run needs of a model, taken apart beforehand: terms as products of a part of inputs and a part of fed-back states."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import StateSet
from mapmore_cli.modelling.expressions import Expression, Name, compiled, derivative, multiply, parse, to_text
from mapmore_cli.modelling.expressions.operator import Recursion
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Lagged, Measured, Operated, State, state
from mapmore_cli.modelling.expressions.syntax import ONE, Power, Product
from mapmore_cli.modelling.memory.states import setting_of

Own = Callable[[Sequence[float]], float]
"""The part of a term that depends on fed-back states, as a function of their values at one sample."""

OUTPUT = -1
"""Place of the output itself, where others are places of nodes."""


@dataclass(frozen=True)
class Node:
    """A state that depends on the output: some samples ago (`steps`), or by a `rule` of an operator; `source` is a node or `OUTPUT`."""

    state: State
    source: int
    steps: int = 0
    rule: Recursion | None = None


@dataclass(frozen=True)
class Feedback:
    """A model's terms, `D_j = own_j(fed-back states) * input_j(states of inputs alone)`.

    - `output`: the quantity that is fed back.
    - `states`: all states of the model.
    - `names`: the m states that are fed back.
    - `inputs`: (k) input parts.
    - `owns`: the G different parts of fed-back states.
    - `groups`: (k) place of each term's part among them, -1 for a term of inputs alone.
    """

    output: str
    states: StateSet
    names: tuple[str, ...]
    inputs: tuple[Expression, ...]
    owns: tuple[Expression, ...]
    groups: tuple[int, ...]

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """Every fed-back state and all that it is made of, sources before what is made of them."""
        places: dict[State, int] = {}
        nodes: list[Node] = []
        for part in (part for name in self.names for part in _parts(state(name))):
            if part in places:
                continue
            source = places.get(part.source, OUTPUT)
            places[part] = len(nodes)
            if isinstance(part, Lagged):
                nodes.append(Node(part, source, part.steps))
            else:
                nodes.append(Node(part, source, rule=OPERATORS[part.operator].recursion(setting_of(part, self.states))))
        return tuple(nodes)

    @cached_property
    def places(self) -> tuple[int, ...]:
        """(m) place of each fed-back state among the nodes."""
        known = [node.state.name for node in self.nodes]
        return tuple(known.index(name) for name in self.names)

    @cached_property
    def longest(self) -> int:
        """Measured outputs that a run begins with."""
        return max(fed_back_states(self.states, self.output).values(), default=0)

    @cached_property
    def depth(self) -> int:
        """Past values that the next sample may need, of the output and of any node."""
        rules = [max(node.rule.own, node.rule.source) for node in self.nodes if node.rule is not None]
        return self.longest + max(rules, default=0) + 1

    @cached_property
    def limits(self) -> tuple[tuple[float, float], ...]:
        """Lower end and width of the scale of each fed-back state; an infinite width, and so zero, where it stood still in training."""
        if not self.states.scaled:
            return ()
        places = [self.states.names.index(name) for name in self.names]
        ends = [(float(self.states.low[place]), float(self.states.high[place])) for place in places]
        return tuple((low, high - low if high > low else math.inf) for low, high in ends)

    @property
    def only_delays(self) -> bool:
        """Whether the output is fed back by delays alone, and by no operator."""
        return all(node.source == OUTPUT and node.rule is None for node in self.nodes)

    @cached_property
    def slopes(self) -> tuple[tuple[str, int, Expression], ...]:
        """Derivatives of the parts of fed-back states that are not zero: by which state, of which part."""
        return tuple(
            (name, place, derivative(own, name)) for place, own in enumerate(self.owns) for name in self.names if name in own.names
        )

    @cached_property
    def functions(self) -> tuple[Own, ...]:
        """The parts of fed-back states as functions."""
        places = {name: place for place, name in enumerate(self.names)}
        return tuple(_own(own, places) for own in self.owns)


def feedback_of(terms: Sequence[str], states: StateSet, output: str) -> Feedback:
    """Take the terms of a model apart.

    Raises DataError for a state or a term that cannot be fed back.
    """
    names = tuple(fed_back_states(states, output))
    parts = [parted(parse(text), names) for text in terms]
    owns = tuple(dict.fromkeys(own for own, _ in parts if own != ONE))
    groups = tuple(owns.index(own) if own != ONE else -1 for own, _ in parts)
    return Feedback(output, states, names, tuple(inputs for _, inputs in parts), owns, groups)


def fed_back_states(states: StateSet, output: str) -> dict[str, int]:
    """Return the states that depend on the output, with how many samples they look back at least.

    Raises DataError for a state of the output as it is now: a model cannot explain its output by itself.
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
        found[name] = sum(part.steps for part in _parts(one) if isinstance(part, Lagged))
    return found


def looks_back(found: State) -> bool:
    """Whether the quantity that a state is made of enters it delayed: `stop(force[k-1], 0.1)` does, `stop(force, 0.1)[k-1]` does not."""
    while not isinstance(found, Measured):
        if isinstance(found, Lagged) and isinstance(found.source, Measured):
            return True
        found = found.source
    return False


def _parts(found: State) -> Iterator[Lagged | Operated]:
    """Yield the state and all that it is made of but the quantity, the innermost first."""
    if not isinstance(found, Measured):
        yield from _parts(found.source)
        yield found


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
                f"the term `{to_text(term)}` has delayed outputs and inputs in one factor, `{to_text(factor)}`",
                "write it as a product of a part with delayed outputs and a part with inputs",
            )
        (fed if own else inputs).append(factor)
    return multiply(*fed), multiply(*inputs)


def _own(expression: Expression, places: Mapping[str, int]) -> Own:
    """`expression` of fed-back states as a function of their list; products of few, the usual case, are the quickest.

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
    return lambda y: float(next(program.values({name: np.float64(y[places[name]]) for name in names})))


def _monomial(expression: Expression, places: Mapping[str, int]) -> list[int]:
    """Places of the factors of a product of powers of states, each as often as it stands; empty for anything else."""
    match expression:
        case Name(name):
            return [places[name]]
        case Power(Name(name), exponent) if exponent > 0 and exponent.is_integer():
            return [places[name]] * int(exponent)
        case Product(factors):
            each = [_monomial(factor, places) for factor in factors]
            return [place for one in each for place in one] if all(each) else []
    return []
