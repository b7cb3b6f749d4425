"""Define the statements of which every model consists. They assign expressions.

Every name is assigned once in its function, before it is used. Statements compute one sample; for
columns, they are applied row by row.
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
    """`names` get the results of the first case whose condition holds, or those of `otherwise`."""

    names: tuple[str, ...]
    cases: tuple[tuple[Condition, Block], ...]
    otherwise: Block

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of all cases, `otherwise` last."""
        return (*(block for _, block in self.cases), self.otherwise)


@dataclass(frozen=True)
class Use:
    """Call of a function with `arguments`, whose results are assigned to `names`."""

    names: tuple[str, ...]
    function: str
    arguments: tuple[Expression, ...]


@dataclass(frozen=True)
class Recall:
    """Assign to `name` the value that was put into a queue `steps` samples ago."""

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
    """Put `value` into a queue. The queue is as long as its longest recall."""

    queue: str
    value: Expression


Statement = Let | Choose | Use | Recall | Keep | Queue


@dataclass(frozen=True)
class Function:
    """Statements that are used in several places; `note` describes what they compute."""

    name: str
    parameters: tuple[str, ...]
    body: Block
    note: str = ""


@dataclass(frozen=True)
class InputLimit:
    """Training range of one input of a model or of a part of it.

    `value` is the input as the part uses it, an expression of the `inputs` of the model. The inputs
    count as outside the range if `value` is outside of it. If the range depends on a level, the
    level is `at`, and `low` and `high`, (L,), are interpolated linearly between the `levels`, (L,).
    Otherwise `at` is None, and there is one range.
    """

    inputs: frozenset[str]
    value: Expression
    at: Expression | None
    levels: Array
    low: Array
    high: Array


@dataclass
class KeptState:
    """Memory that a model keeps from sample to sample.

    - `numbers`: single numbers by name, with their values after a reset.
    - `queues`: names of delayed values, with the length of each queue.
    - `fed_back`: for each output, the queues that feed it back, one for each summand that needs it.
    - `steps`: times between samples of the parts with memory, s; empty for a model without memory.
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
    """A model that can be evaluated, or written in another language. Its inputs are names in the
    statements.

    The results of its body are the outputs. For each input, `knots` holds the places at which the
    program changes to another branch.
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
