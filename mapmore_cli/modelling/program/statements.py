"""Statements that every model consists of; they assign expressions of `terms`.

Every name is assigned once in its function, before it is used. Statements work on one sample; along
a column they work row by row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import Expression, Name
from mapmore_cli.modelling.expressions.syntax import Condition

NOTHING = Name("not_a_number")  # NaN: no value


@dataclass(frozen=True)
class Let:
    """`name = value`."""

    name: str
    value: Expression


@dataclass(frozen=True)
class Block:
    """Statements, and the expressions that are their results."""

    statements: tuple[Statement, ...]
    results: tuple[Expression, ...]


@dataclass(frozen=True)
class Choose:
    """`names` are the results of the first case whose condition holds, else those of
    `otherwise`.
    """

    names: tuple[str, ...]
    cases: tuple[tuple[Condition, Block], ...]
    otherwise: Block

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The sides, `otherwise` last."""
        return (*(block for _, block in self.cases), self.otherwise)


@dataclass(frozen=True)
class Use:
    """`names` are the results of a function at the arguments."""

    names: tuple[str, ...]
    function: str
    arguments: tuple[Expression, ...]


@dataclass(frozen=True)
class Recall:
    """`name` is the value put into a queue so many steps ago."""

    name: str
    queue: str
    steps: int


@dataclass(frozen=True)
class Keep:
    """Keep a value under the name `kept` for the next sample."""

    kept: str
    value: Expression


@dataclass(frozen=True)
class Queue:
    """Put `value` into a queue, which is as long as the longest recall."""

    queue: str
    value: Expression


Statement = Let | Choose | Use | Recall | Keep | Queue


@dataclass(frozen=True)
class Function:
    """Statements that several places share; `note` says what they compute."""

    name: str
    parameters: tuple[str, ...]
    body: Block
    note: str = ""


@dataclass(frozen=True)
class InputLimit:
    """Training range of one input of a model or of a part of it.

    `inputs` are beyond it where `value` is, the input as the part knows it. Where the range depends
    on a level, that is `at`: `low` and `high` (L,) are linear between the `levels` (L,); else `at`
    is None, and there is one range.
    """

    inputs: frozenset[str]
    value: Expression
    at: Expression | None
    levels: Array
    low: Array
    high: Array


@dataclass
class KeptState:
    """Memory of a model from sample to sample.

    - `numbers`: single numbers by name, and what they are after a reset.
    - `queues`: delayed values by name, and how many of them.
    - `fed_back`: by output, the queues of it that the model, or several summands of it, go on from.
    - `steps`: times between samples of the parts with memory, s; none for a model without memory.
    """

    numbers: dict[str, float] = field(default_factory=dict)
    queues: dict[str, int] = field(default_factory=dict)
    fed_back: dict[str, list[str]] = field(default_factory=dict)
    steps: list[float] = field(default_factory=list)

    @property
    def step(self) -> float | None:
        """Time between samples, s; None for a model without memory."""
        return self.steps[0] if self.steps else None


@dataclass(frozen=True)
class Program:
    """A model, ready to be evaluated or written in another language; its inputs are names in the
    statements.

    The results of its body are the outputs. `knots` has, by input, places at which the program
    takes another side.
    """

    inputs: tuple[str, ...]
    functions: tuple[Function, ...]
    body: Block
    limits: tuple[InputLimit, ...]
    kept: KeptState = field(default_factory=KeptState)
    knots: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def step(self) -> float | None:
        """Time between samples, s; None for a model without memory."""
        return self.kept.step
