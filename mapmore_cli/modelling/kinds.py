"""What every kind of model can do: the verbs of a kind, and the same for a model of any kind.

A kind is a `Kind`, called `KIND`, in a package of `modelling/`, or one that an entry point in the
group `mapmore.kinds` names. Its verbs are imported when a model of the kind is there.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Protocol

import numpy as np

from mapmore_cli.domain import plugins
from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.declared import Settings
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.fits import Fit
from mapmore_cli.domain.models import Body, Equation, Model
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling.expressions import Expression, ExpressionError
from mapmore_cli.modelling.program.writing import Inputs, Writer
from mapmore_cli.modelling.ranges import outside_limits


class Verbs(Protocol):
    """Operations of a kind of model.

    A kind derives from this class. It defines the first four verbs; each of the others has an
    answer here, which suits models whose rows are independent of each other.
    """

    @abstractmethod
    def simulate(self, model: Model, columns: Columns) -> SimulatedRun:
        """Return the output at every row, (n,), NaN where an input is NaN or there is no
        history.
        """

    @abstractmethod
    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return the model in physical units; `units` says how many of the model's units one unit
        of a quantity is.
        """

    @abstractmethod
    def parameters(self, model: Model) -> int:
        """Return how many numbers the fit was free to choose."""

    @abstractmethod
    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:
        """Write the model as statements; return its output."""

    def running(self, model: Model) -> Callable[[Columns], SimulatedRun] | None:  # noqa: ARG002
        """Return a function that simulates one recording block after block; None if the kind needs
        the whole recording at once.
        """
        return None

    def one_step(self, model: Model, columns: Columns) -> Array:
        """Return the prediction of every row from the measured past, (n,)."""
        return self.simulate(model, columns).values

    def settled(self, model: Model, columns: Columns) -> Array:
        """Return the output where inputs stand still, (n,)."""
        return self.simulate(model, columns).values

    def fed_back(self, model: Model) -> tuple[str, ...]:  # noqa: ARG002
        """Return the measured outputs that a run begins from."""
        return ()

    def outside_range(self, model: Model, columns: Columns) -> BoolArray:
        """Return True if an input lies beyond the `ranges` of the body, (n,)."""
        return outside_limits(getattr(model.body, "ranges", ()), model.level, columns)

    def rules(self, model: Model) -> Iterable[str]:  # noqa: ARG002
        """Return how the equations are put together, in sentences."""
        return ()

    def faults(self, model: Model) -> Iterable[str]:  # noqa: ARG002
        """Return why a stored model is refused (`soundness`)."""
        return ()


@dataclass(frozen=True)
class Kind:
    """A kind of model: its name in files and on pages, the types of its models and of its fits.

    - `verbs`: imports and returns what the kind does.
    - `over_time`: rows are samples of a recording, which the model runs along.
    - `settings`: the keys of `model: {type: NAME}` in a spec, where the kind has keys of its own.

    A kind that adds itself derives from this class and defines what rooms above ask it for:
    `maker` (`fitting.kinds.Fitted`), `findings` (`study.check_study.Checked`), `section` and
    `show_fit` (`reporting.sections.Paged`), `show` (`cli.views.Shown`).
    """

    name: str
    body: type[Body]
    fit: type[Fit] | None
    verbs: Callable[[], Verbs]
    over_time: bool = False
    settings: type[Settings] = Settings


@cache
def kinds() -> tuple[Kind, ...]:
    """Return every kind, in the order of their names."""
    parts = plugins.parts("kinds", Kind, "mapmore_cli.modelling")
    return tuple(sorted((part.value for part in parts), key=lambda kind: kind.name))


def named(name: str) -> Kind:
    """Return the kind of a name; raises NotInstalled if that is a part that is missing."""
    kind = next((kind for kind in kinds() if kind.name == name), None) or plugins.load(
        "kinds", name
    )
    assert isinstance(kind, Kind)
    return kind


def kind_of(model: Model) -> Kind:
    """Return the kind of a model."""
    return next(kind for kind in kinds() if kind.body is type(model.body))


def verbs_of(model: Model) -> Verbs:
    """Return what the kind of a model does."""
    return kind_of(model).verbs()


def kind_of_fit(fit: Fit | None) -> Kind | None:
    """Return the kind of a fit; None if nothing was fitted."""
    return next((kind for kind in kinds() if kind.fit is type(fit)), None)


def alone(model: Model) -> Model:
    """Return a model of one output; UsageError for one of several, which nobody can mean by one
    number.
    """
    names = [output.name for output in model.outputs]
    if len(names) > 1:
        raise UsageError(
            f"the model {model.name} has the outputs {', '.join(names)}, but this works "
            "with one output only",
            f"make a model of one of them: set `target: {names[0]}`",
        )
    return model


def predict(model: Model, columns: Columns) -> Array:
    """Output of the model at every row, (n,), as `simulate` has it."""
    return simulate(model, columns).values


def simulate(model: Model, columns: Columns) -> SimulatedRun:
    """Output of the model at every row, (n,), NaN where an input is NaN; and the rows at which a
    free run diverges.

    A model with memory runs free along one recording: it has no prediction before there is history,
    and starts again after rows with a NaN.

    - `columns`: the model's inputs by name, each (n,), in the model's units; with memory also
      `time`, and the output where it is fed back.

    Raises KeyError if an input is missing; DataError if a free run has nothing to begin from,
    or samples are not at the model's time steps.
    """
    return verbs_of(model).simulate(model, columns)


def settled(model: Model, columns: Columns) -> Array:
    """Output of the model where its inputs stand still, (n,): `predict`, but with memory what a run
    comes to rest at.

    Raises FitError if it does not.
    """
    return verbs_of(model).settled(model, columns)


def running(model: Model) -> Callable[[Columns], SimulatedRun] | None:
    """Return a function that simulates one recording block after block; None if the kind needs the
    whole recording at once.
    """
    return verbs_of(model).running(model)


def outside_range(model: Model, columns: Columns) -> BoolArray:
    """Return True if an input lies beyond the training range, of any summand where the model is
    a sum, (n,).
    """
    return verbs_of(model).outside_range(model, columns)


@contextmanager
def numbers_in_reach(model: Model) -> Iterator[None]:
    """Raise DataError for a model whose coefficients multiply to what is no number, as in a file
    that somebody changed.
    """
    try:
        with np.errstate(over="ignore"):  # infinity is no number
            yield
    except ExpressionError as fault:
        raise DataError(
            f"the model {model.name} cannot be written as equations: {fault.message}",
            "run its spec again",
        ) from fault


def equations(
    model: Model, units: Mapping[str, float] = MappingProxyType({})
) -> tuple[Equation, ...]:
    """Return the model as equations, in its units or in others: of a sum, those of each summand.

    Raises DataError if a coefficient is too large to be a number.
    """
    with numbers_in_reach(model):
        return verbs_of(model).equations(model, units)


def rules(model: Model) -> tuple[str, ...]:
    """Return how its equations are put together, in sentences: whoever has both can compute it."""
    return tuple(verbs_of(model).rules(model))


def parameters(model: Model) -> int:
    """Return the number of free parameters: coefficients of terms and parameters of formulas, in a
    sum of all parts.
    """
    return verbs_of(model).parameters(model)


def one_step_ahead(model: Model, columns: Columns) -> Array:
    """Prediction of every row from the measured past, (n,); NaN before there is history."""
    return verbs_of(model).one_step(model, columns)


def runs_over_time(model: Model) -> bool:
    """Return True if rows are samples of a recording, which the model runs along."""
    return any(kind_of(part).over_time for part in model.every)


def fed_back(model: Model) -> tuple[str, ...]:
    """Return the measured outputs that a run begins from, each once."""
    return verbs_of(model).fed_back(model)
