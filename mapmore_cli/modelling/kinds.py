"""What every kind of model can do, and where a model was trained.

A kind is a package with a `KIND`, which says its name, and a file `model.py`, which holds its
verbs. It is a folder of `modelling/`, or an entry point in the group `mapmore.kinds` names its
`KIND`. The verbs are imported when a model of the kind is there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from types import MappingProxyType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from mapmore_cli.domain import plugins
from mapmore_cli.domain.arrays import Array, BoolArray, Columns, row_count
from mapmore_cli.domain.declared import Settings
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.models import CurveRange, Equation, Model
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.expressions import ExpressionError


@dataclass(frozen=True)
class Kind:
    """A kind of model: its name in files and on pages, the types of its models and of its fits, and
    the package with its verbs.

    `settings` has the keys of `model: {type: NAME}` in a spec, where the kind has keys of its own.
    `over_time` says that rows are samples of a recording, which the model runs along. `fitted` is
    the module that fits it, where that is not the file of its name in `fitting/kinds/`.

    `model.py` in the package has these functions of a `model`.

    - `simulate(model, columns)`: the `Run` at every row, NaN where an input is NaN or there is no
      history.
    - `equations(model, units)`: the model in physical units, given how many of the model's units
      one unit of a quantity is.
    - `parameters(model)`: how many numbers the fit was free to choose.
    - `write(m, model, inputs)`: the model as statements of the writer `m`; its output.

    Some have others: `running(model)`, what simulates one recording block after block;
    `one_step(model, columns)`, the prediction of every row from the measured past, (n,);
    `fed_back(model)`, the measured outputs that a run begins from; `outside_range(model, columns)`,
    (n,), for a body without `ranges`; `settled(model, columns)`, the output where inputs stand
    still, (n,); `rules(model)`, how its equations are put together;
    `faults(model)`, why a stored one is refused (`soundness`).

    A kind that adds itself may have `checks.py`, with `findings(spec)`, what a spec may not say;
    and `page.py`, with `show(model, show_other)`; of a kind with fits also
    `show_fit(fit)`, and of a section of pages `tables(inputs)` and `TITLE`.
    """

    name: str
    body: type
    fit: type | None
    package: str
    over_time: bool = False
    settings: type[Settings] = Settings
    fitted: str = ""

    def verb(self, name: str, otherwise: Any = None, of: str = "model") -> Any:
        """Return a function of a module of the package; `otherwise` where it has none of the
        name.
        """
        try:
            return getattr(import_module(f"{self.package}.{of}"), name, otherwise)
        except ModuleNotFoundError as fault:
            if fault.name != f"{self.package}.{of}":
                raise
            return otherwise

    @property
    def page(self) -> ModuleType | None:
        """The module `page.py` of the package, where it has one."""
        return (
            None if self.verb("show", of="page") is None else import_module(f"{self.package}.page")
        )


@cache
def kinds() -> tuple[Kind, ...]:
    """Return every kind, in the order of their names."""
    found = plugins.parts("kinds", Kind, "mapmore_cli.modelling")
    return tuple(sorted((part.value for part in found), key=lambda kind: kind.name))


def named(name: str) -> Kind:
    """Return the kind of a name; raises NotInstalled where that is a part that is missing."""
    own = next((kind for kind in kinds() if kind.name == name), None)
    return plugins.load("kinds", name) if own is None else own


def page_of(fit: Any) -> ModuleType | None:
    """Return the module that shows fits of their kind on pages, where the kind has one."""
    kind = next((kind for kind in kinds() if kind.fit is type(fit)), None)
    return kind.page if kind else None


def alone(model: Model) -> Model:
    """Return a model of one output; UsageError for one of several, which nobody can mean by one
    number.
    """
    names = [one.name for one in model.outputs]
    if len(names) > 1:
        raise UsageError(
            f"the model {model.name} has the outputs {', '.join(names)}, and this is done with one",
            f"make a model of one of them: set `target: {names[0]}`",
        )
    return model


def kind_of(model: Model) -> Kind:
    """Return the kind of a model."""
    return next(kind for kind in kinds() if kind.body is type(model.body))


def predict(model: Model, columns: Columns) -> Array:
    """Output of the model at every row, (n,), as `simulate` has it."""
    return simulate(model, columns).values


def simulate(model: Model, columns: Columns) -> Run:
    """Output of the model at every row, (n,), NaN where an input is NaN; and the rows at which a
    free run diverges.

    A model with memory runs free along one recording: it has no prediction before there is history,
    and starts anew after rows with a NaN.

    - `columns`: the model's inputs by name, each (n,), in the model's units; with memory also
      `time`, and the output where it is fed back.

    Raises KeyError where an input is missing; DataError where a free run has nothing to begin from,
    or samples are not at the model's time steps.
    """
    run: Run = kind_of(model).verb("simulate")(model, columns)
    return run


def settled(model: Model, columns: Columns) -> Array:
    """Output of the model where its inputs stand still, (n,): `predict`, but with memory what a run
    comes to rest at.

    Raises FitError where it does not.
    """
    return np.asarray(kind_of(model).verb("settled", predict)(model, columns))


def running(model: Model) -> Callable[[Columns], Run] | None:
    """Return what simulates one recording block after block; None of a kind that wants it whole."""
    next_rows: Callable[[Columns], Run] | None = kind_of(model).verb("running", lambda _: None)(
        model
    )
    return next_rows


def outside_range(model: Model, columns: Columns) -> BoolArray:
    """Return True where an input lies beyond the training range, of any summand where the model is
    a sum, (n,).
    """
    outside: BoolArray = kind_of(model).verb("outside_range", _outside_limits)(model, columns)
    return outside


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
            f"the model {model.name} cannot be written out: {fault.message}",
            "make it anew by its spec",
        ) from fault


def equations(
    model: Model, units: Mapping[str, float] = MappingProxyType({})
) -> tuple[Equation, ...]:
    """Return the model as equations, in its units or in others: of a sum, those of each summand.

    Raises DataError where a coefficient is too large to be a number.
    """
    with numbers_in_reach(model):
        rows: tuple[Equation, ...] = kind_of(model).verb("equations")(model, units)
    return rows


def rules(model: Model) -> tuple[str, ...]:
    """Return how its equations are put together, in sentences: whoever has both can compute it."""
    return tuple(kind_of(model).verb("rules", lambda _model: ())(model))


def parameters(model: Model) -> int:
    """Return the number of free parameters: coefficients of terms and parameters of formulas, in a
    sum of all parts.
    """
    count: int = kind_of(model).verb("parameters")(model)
    return count


def one_step_ahead(model: Model, columns: Columns) -> Array:
    """Prediction of every row from the measured past, (n,); NaN before there is history."""
    predicted: Array = kind_of(model).verb("one_step", predict)(model, columns)
    return predicted


def runs_over_time(model: Model) -> bool:
    """Return True where rows are samples of a recording, which the model runs along."""
    return any(kind_of(one).over_time for one in model.every)


def fed_back(model: Model) -> tuple[str, ...]:
    """Return the measured outputs that a run begins from, each once."""
    outputs: tuple[str, ...] = kind_of(model).verb("fed_back", lambda _model: ())(model)
    return outputs


OUTSIDE_TOLERANCE = 1e-9
"""Inputs within this fraction of a range beyond its end still count as inside: the end itself must
not be flagged by rounding.
"""


class InputRange(NamedTuple):
    """Training range of one input: `low` to `high`, (L,) each; linear between `levels`, (L,), of
    the input `at` where that is not None.
    """

    name: str
    at: str | None
    levels: Array
    low: Array
    high: Array


def limits(ranges: Sequence[CurveRange], level: str | None) -> Iterator[InputRange]:
    """Yield the training range of every input, the level first: its own is that of its levels, (1,)
    each.

    That of any other input is interpolated linearly between the curves, since each curve has its
    own (free strain grows with pressure).
    """
    if not ranges:
        return
    levels = (
        np.array([one.level for one in ranges], dtype=np.float64)
        if level is not None
        else np.empty(0)
    )
    if level is not None:
        yield InputRange(level, None, levels, levels[:1], levels[-1:])
    for name in ranges[0].limits:
        if name != level:
            low, high = np.array([one.limits[name] for one in ranges]).T
            yield InputRange(name, level, levels, low, high)


def _outside_limits(model: Model, columns: Columns) -> BoolArray:
    outside = np.zeros(row_count(columns), dtype=np.bool_)
    ranges = model.body.ranges  # type: ignore[attr-defined]  # sums have another verb
    for name, at, levels, *ends in limits(ranges, model.level):
        if name in columns:
            low, high = (
                end[:1] if at is None else np.interp(columns[at], levels, end) for end in ends
            )
            margin = OUTSIDE_TOLERANCE * np.maximum(
                high - low, np.maximum(np.abs(low), np.abs(high))
            )
            outside |= (columns[name] < low - margin) | (columns[name] > high + margin)
    return outside
