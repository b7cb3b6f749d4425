"""Define what every kind of model can do. Each kind has a set of operations (its verbs), and the
functions here apply these operations to a model of any kind.

A kind is an object of the class `Kind`. It is called `KIND` in a package of `modelling/`, or an
entry point in the group `mapmore.kinds` names it. Its verbs are imported when a model of this kind
is first used.
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

    Every kind derives from this class and defines the first four operations. The other operations
    have default implementations, which suit models that predict each row independently of the other
    rows.
    """

    @abstractmethod
    def simulate(self, model: Model, columns: Columns) -> SimulatedRun:
        """Return the output at every row, shape (n,); NaN for a row if one of its inputs is NaN, or
        if the model needs more earlier rows than there are.
        """

    @abstractmethod
    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return the model as equations in physical units. `units` gives the number of the model's
        units in one printed unit of a quantity.
        """

    @abstractmethod
    def parameters(self, model: Model) -> int:
        """Return the number of free parameters: the coefficients and parameters that the fit
        determined.
        """

    @abstractmethod
    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:
        """Write the model as statements of a program, and return the variable of its output."""

    def running(self, model: Model) -> Callable[[Columns], SimulatedRun] | None:  # noqa: ARG002
        """Return a function that simulates one recording block after block; None if the kind needs
        the whole recording at once.
        """
        return None

    def one_step(self, model: Model, columns: Columns) -> Array:
        """Return the one-step-ahead prediction of every row, from measured outputs, shape (n,)."""
        return self.simulate(model, columns).values

    def settled(self, model: Model, columns: Columns) -> Array:
        """Return the output for constant inputs after all transients, shape (n,)."""
        return self.simulate(model, columns).values

    def fed_back(self, model: Model) -> tuple[str, ...]:  # noqa: ARG002
        """Return the names of the outputs that are fed back. A free run needs measured values of
        these outputs at its start.
        """
        return ()

    def outside_range(self, model: Model, columns: Columns) -> BoolArray:
        """Return True for rows at which an input lies outside its training range, shape (n,). The
        training ranges are the attribute `ranges` of the model's body.
        """
        return outside_limits(getattr(model.body, "ranges", ()), model.level, columns)

    def rules(self, model: Model) -> Iterable[str]:  # noqa: ARG002
        """Return sentences that say how the equations are combined."""
        return ()

    def faults(self, model: Model) -> Iterable[str]:  # noqa: ARG002
        """Yield a sentence for each fault of a stored model. If there is a fault, the model is
        refused (see the module `soundness`).
        """
        return ()


@dataclass(frozen=True)
class Kind:
    """A kind of model: its name in files and on pages, and the types of its models and its fits.

    - `verbs`: function that imports and returns the operations of the kind.
    - `over_time`: True if the model is computed along a recording, because its output depends on
      earlier samples.
    - `settings`: the keys of `model: {type: NAME}` in a spec, if the kind has keys of its own.

    A kind in a plug-in is a subclass of this class. It also defines the attributes that higher
    layers use: `maker` (`fitting.kinds.Fitted`), `findings` (`study.checks.target.Checked`),
    `section` and `show_fit` (`reporting.sections.Paged`), `show` (`cli.views.Shown`).
    """

    name: str
    body: type[Body]
    fit: type[Fit] | None
    verbs: Callable[[], Verbs]
    over_time: bool = False
    settings: type[Settings] = Settings


OWN_TYPES = ("mapmore", "literature", "auto")
"""Words for the `type` of a model that mean no single kind; no kind may have such a name."""


@cache
def kinds() -> tuple[Kind, ...]:
    """Return all kinds in the order of their names."""
    parts = plugins.parts("kinds", Kind, "mapmore_cli.modelling", OWN_TYPES)
    return tuple(sorted((part.value for part in parts), key=lambda kind: kind.name))


def named(name: str) -> Kind:
    """Return the kind with a name. Raises NotInstalled if the kind belongs to a part of mapmore
    that is not installed.
    """
    kind = next((kind for kind in kinds() if kind.name == name), None) or plugins.load(
        "kinds", name
    )
    assert isinstance(kind, Kind)
    return kind


def kind_of(model: Model) -> Kind:
    """Return the kind of a model."""
    return next(kind for kind in kinds() if kind.body is type(model.body))


def verbs_of(model: Model) -> Verbs:
    """Return the operations of the kind of a model."""
    return kind_of(model).verbs()


def kind_of_fit(fit: Fit | None) -> Kind | None:
    """Return the kind of a fit; None if nothing was fitted."""
    return next((kind for kind in kinds() if kind.fit is type(fit)), None)


def alone(model: Model) -> Model:
    """Return the model unchanged if it has only one output. Raises UsageError if it has several
    outputs, because the caller needs a model with one output.
    """
    names = [output.name for output in model.outputs]
    if len(names) > 1:
        raise UsageError(
            f"the model {model.name} has the outputs {', '.join(names)}, but only "
            "a model with one output can be used here",
            f"make a model of one of them: set `target: {names[0]}`",
        )
    return model


def predict(model: Model, columns: Columns) -> Array:
    """Return the output of the model at every row, shape (n,), as `simulate` computes it."""
    return simulate(model, columns).values


def simulate(model: Model, columns: Columns) -> SimulatedRun:
    """Return the output of the model at every row, shape (n,), NaN if an input is NaN; and the rows
    at which a free run diverges.

    A model with memory is computed in free run along one recording. The free run starts from the
    first rows, which therefore have no prediction, and starts again after rows with a NaN.

    - `columns`: the model's inputs by name, each (n,), in the model's units; for a model with
      memory also `time`, and the output if it is fed back.

    Raises KeyError if an input is missing; DataError if a free run has no measured output to begin
    with, or if the time steps differ from those of the model.
    """
    return verbs_of(model).simulate(model, columns)


def settled(model: Model, columns: Columns) -> Array:
    """Return the output of the model for constant inputs, shape (n,). For a model with memory, this
    is the final value of the output when all inputs stay constant. For any other model, it is the
    result of `predict`.

    Raises FitError if the output does not become constant.
    """
    return verbs_of(model).settled(model, columns)


def running(model: Model) -> Callable[[Columns], SimulatedRun] | None:
    """Return a function that simulates one recording block after block; None if the kind needs the
    whole recording at once.
    """
    return verbs_of(model).running(model)


def outside_range(model: Model, columns: Columns) -> BoolArray:
    """Return True for rows at which an input lies outside the training range, shape (n,). For a
    sum, the result is True if a row is outside the training range of at least one of the summands.
    """
    return verbs_of(model).outside_range(model, columns)


@contextmanager
def numbers_in_reach(model: Model) -> Iterator[None]:
    """Raise DataError if a product of a model's coefficients is not finite, for example because
    somebody changed the file.
    """
    try:
        # an overflow gives infinity, which the check for finite values reports
        with np.errstate(over="ignore"):
            yield
    except ExpressionError as fault:
        raise DataError(
            f"the model {model.name} cannot be written as equations: {fault.message}",
            "repeat the run that made it",
        ) from fault


def equations(
    model: Model, units: Mapping[str, float] = MappingProxyType({})
) -> tuple[Equation, ...]:
    """Return the equations of the model, in its own units or in those given by `units`. For a sum,
    the equations of each summand are returned.

    Raises DataError if a coefficient is too large for a floating-point number.
    """
    with numbers_in_reach(model):
        return verbs_of(model).equations(model, units)


def rules(model: Model) -> tuple[str, ...]:
    """Return sentences that say how the equations of the model are combined, so that a reader can
    compute the model by hand.
    """
    return tuple(verbs_of(model).rules(model))


def parameters(model: Model) -> int:
    """Return the number of free parameters: coefficients of terms and parameters of formulas. For a
    sum, the parameters of all summands are counted.
    """
    return verbs_of(model).parameters(model)


def one_step_ahead(model: Model, columns: Columns) -> Array:
    """Return the one-step-ahead prediction of every row, from measured outputs, shape (n,). The
    first rows are NaN if the model needs earlier samples.
    """
    return verbs_of(model).one_step(model, columns)


def runs_over_time(model: Model) -> bool:
    """Return True if the model is computed along a recording, because its output depends on earlier
    samples.
    """
    return any(kind_of(part).over_time for part in model.every)


def fed_back(model: Model) -> tuple[str, ...]:
    """Return the names of the outputs that are fed back, without repetitions. A free run needs
    measured values of these outputs at its start.
    """
    return verbs_of(model).fed_back(model)
