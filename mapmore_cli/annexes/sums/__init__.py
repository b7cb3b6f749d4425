"""Add models, for example a static and a damping model (section 3 of Veale, Xie and Anderson
2018).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from mapmore_cli.domain.arrays import Number
from mapmore_cli.domain.declared import QuantityName, TermName
from mapmore_cli.domain.models import Body, Model
from mapmore_cli.modelling.kinds import Kind, Verbs

if TYPE_CHECKING:
    from mapmore_cli.cli.console import View
    from mapmore_cli.fitting.kinds import Maker
    from mapmore_cli.study.diagnostics import Finding
    from mapmore_cli.study.experiment import ExperimentSpec


@dataclass(frozen=True)
class Part:
    """One of the models whose outputs a sum adds.

    An input of the model may be the output of another model, for example the pressure behind a
    valve. `fed` holds such other models. The output of each has the name of the input that it
    provides.
    """

    model: Annotated[Model, "the model"]
    sign: Annotated[Number, "sign of its output in the sum, +1 or -1"] = 1.0
    inputs: Annotated[
        Mapping[QuantityName, TermName],
        "its inputs that have another name in the sum, as expressions of the sum's inputs",
    ] = field(default_factory=dict)
    fed: Annotated[tuple[Part, ...], "models whose outputs are inputs of this one"] = ()

    @property
    def models(self) -> tuple[Model, ...]:
        """The model of this summand, and the models whose outputs are its inputs."""
        return (self.model, *(model for part in self.fed for model in part.models))


@dataclass(frozen=True)
class Sum(Body):
    """The stored form of a sum: several models, which are added."""

    parts: Annotated[tuple[Part, ...], "the summands, with their signs and inputs"]

    @property
    def models(self) -> tuple[Model, ...]:
        """The models of all summands, and the models whose outputs are their inputs."""
        return tuple(model for part in self.parts for model in part.models)


@dataclass(frozen=True)
class SumKind(Kind):
    """The kind of sums of models. The other files of this package are imported only when they are
    needed.
    """

    def maker(self) -> Maker:
        """Return the object that makes sums from specs."""
        from mapmore_cli.annexes.sums.fitted import SumMaker

        return SumMaker()

    def findings(self, spec: ExperimentSpec) -> Iterator[Finding]:
        """Check every sum of a spec."""
        from mapmore_cli.annexes.sums.checks import findings

        return findings(spec)

    def show(self, model: Model, show_other: Callable[[Model], View]) -> View:
        """Return what `mapmore show` prints about a sum."""
        from mapmore_cli.annexes.sums.page import show

        return show(model, show_other)


def _verbs() -> Verbs:
    from mapmore_cli.annexes.sums.model import SumVerbs

    return SumVerbs()


KIND = SumKind("sum", Sum, None, _verbs)
