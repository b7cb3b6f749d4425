"""Define the statements of which every program consists. They assign the values of expressions to
names. Within a function, every name is assigned only once, before it is used.

The statements compute one sample; for columns, they are applied to every row.
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
    """Statement `name = value`."""

    name: str
    value: Expression


@dataclass(frozen=True)
class Block:
    """A sequence of statements, and the expressions whose values are its results."""

    statements: tuple[Statement, ...]
    results: tuple[Expression, ...]


@dataclass(frozen=True)
class Choose:
    """Branch statement. `names` get the results of the first case whose condition holds, or of
    `otherwise` if none holds.
    """

    names: tuple[str, ...]
    cases: tuple[tuple[Condition, Block], ...]
    otherwise: Block

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of all cases, followed by the block `otherwise`."""
        return (*(block for _, block in self.cases), self.otherwise)


@dataclass(frozen=True)
class Use:
    """Statement that calls a function with `arguments`, and assigns the results of the function to
    `names`.
    """

    names: tuple[str, ...]
    function: str
    arguments: tuple[Expression, ...]


@dataclass(frozen=True)
class Recall:
    """Statement that assigns to `name` the value that was appended to a queue `steps` samples
    ago.
    """

    name: str
    queue: str
    steps: int


@dataclass(frozen=True)
class Store:
    """Statement that stores `value` under the name `kept` for the next sample."""

    kept: str
    value: Expression


@dataclass(frozen=True)
class Queue:
    """Statement that appends `value` to a queue of past values. Older values than the statements
    `Recall` of this queue need are removed.
    """

    queue: str
    value: Expression


Statement = Let | Choose | Use | Recall | Store | Queue


@dataclass(frozen=True)
class Function:
    """A function of the program: a block that can be used in several places. `note` describes what
    it computes.
    """

    name: str
    parameters: tuple[str, ...]
    body: Block
    note: str = ""


@dataclass(frozen=True)
class InputLimit:
    """Training range of one input of a model. For a sum, this may be an input of one of its
    summands.

    `value` is the expression of this input, and `inputs` are the names of the inputs of the whole
    model on which the expression depends. A prediction extrapolates if `value` is outside its
    range.

    If the range depends on a level, `at` is the expression of the level. The ends of the range,
    `low` and `high`, (L,), are then interpolated linearly between the `levels`, (L,). Otherwise,
    `at` is None, and there is only one range.
    """

    inputs: frozenset[str]
    value: Expression
    at: Expression | None
    levels: Array
    low: Array
    high: Array


@dataclass
class KeptState:
    """Values that a model keeps from one sample to the next.

    - `numbers`: single numbers by name, with their values after a reset.
    - `queues`: names of delayed values, with the length of each queue.
    - `fed_back`: for each output that is fed back, its queues. In a sum, each summand that needs
      the output has a queue.
    - `steps`: time between samples, in s, of each part with memory; empty for a model without
      memory.
    """

    numbers: dict[str, float] = field(default_factory=dict)
    queues: dict[str, int] = field(default_factory=dict)
    fed_back: dict[str, list[str]] = field(default_factory=dict)
    steps: list[float] = field(default_factory=list)

    @property
    def step(self) -> float | None:
        """Time between samples in s; None for a model without memory."""
        return self.steps[0] if self.steps else None


@dataclass(frozen=True)
class Program:
    """A model as statements, which can be evaluated or written in another language. Its inputs are
    names that the statements use, and the results of its body are the outputs. For each input,
    `knots` holds the places at which the program changes to another branch.
    """

    inputs: tuple[str, ...]
    functions: tuple[Function, ...]
    body: Block
    limits: tuple[InputLimit, ...]
    kept: KeptState = field(default_factory=KeptState)
    knots: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @property
    def step(self) -> float | None:
        """Time between samples in s; None for a model without memory."""
        return self.kept.step
