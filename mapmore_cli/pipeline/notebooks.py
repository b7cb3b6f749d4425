"""Use models and tables in notebooks and scripts: a model as a function, and tables in memory
(mappings of arrays, data frames) instead of files.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import TypeAdapter

from mapmore_cli.domain import plugins
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.models import Equation, Model
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.inverse import LOWEST, Inverse, invert
from mapmore_cli.modelling.kinds import alone, outside_range, predict
from mapmore_cli.modelling.kinds import equations as model_equations
from mapmore_cli.modelling.programs import slopes
from mapmore_cli.modelling.signals.rates import with_signals
from mapmore_cli.modelling.validation.intervals import INTERVAL, interval
from mapmore_cli.pipeline.frames import labels_of
from mapmore_cli.pipeline.records import reading_of
from mapmore_cli.pipeline.tables_in_memory import (
    columns_in,
    given_numbers,
    quantities_of,
    source_of,
)
from mapmore_cli.storage.outputs import write_chosen
from mapmore_cli.study.sections.logs import SourceColumn
from mapmore_cli.study.units import default_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class LoadedModel:
    """A model as a function with one keyword argument for every input, in the model's units. If
    `time` is given, inputs that are rates or directions of motion may be left out, because they are
    computed from the time. If points lie outside the training range, the call warns (UserWarning),
    and returns extrapolated values. Raises `TypeError` if an input is missing or unknown.

    A model with memory takes one recording: its `time` in s, and the measured output if the model
    feeds its output back. A model of several outputs returns a mapping from the names of the
    outputs to their values; `of` returns the model of one output.

    Examples
    --------
    A model from `fit` is called in the same way as a model from `load_model`.

    >>> import numpy as np
    >>> import mapmore_cli as mm
    >>> x = np.linspace(100, 300, 20)
    >>> model = mm.fit({"pressure": x, "force": 2 * x}, target={"column": "force"},
    ...     dictionary=[{"polynomial": {"of": ["pressure"], "order": 1}}],
    ...     validate={"simple": False})
    >>> model(pressure=[150.0, 200.0]).round(6)
    array([300., 400.])
    """

    model: Model
    scores: Sequence[Mapping[str, Any]] = ()  # rows of `scores.json` beside the model file
    held_out: tuple[Curve, ...] = field(default=(), kw_only=True)

    def __repr__(self) -> str:
        """Return a text with the names of the model, of its outputs and of its inputs."""
        inputs = ", ".join(quantity.label for quantity in self.inputs) or "its own past"
        outputs = ", ".join(output.label for output in self.model.outputs)
        return f"<model {self.model.name}: {outputs} of {inputs}>"

    def of(self, output: str) -> Self:
        """Return the model of the output `output`. Raises TypeError if the model has no such
        output.
        """
        if output not in (names := [output.name for output in self.model.outputs]):
            raise TypeError(f"this model has the outputs {', '.join(names)}; got {output!r}")
        return replace(self, model=self.model.of(output))

    @property
    def units(self) -> dict[str, str]:
        """Units of the inputs and the outputs, by name."""
        return {quantity.name: quantity.unit for quantity in (*self.inputs, *self.model.outputs)}

    @property
    def inputs(self) -> tuple[Quantity, ...]:
        """Names and units of the inputs."""
        return self.model.inputs

    @property
    def output(self) -> Quantity:
        """Name and unit of the output. If the model has several outputs, it is the first output."""
        return self.model.output

    @property
    def equations(self) -> tuple[Equation, ...]:
        """The model in physical units, as text and LaTeX."""
        return model_equations(self.model)

    def __call__(self, **columns: ArrayLike) -> Any:
        """Return the output for the given inputs, which are broadcast against each other. The
        output is NaN if an input is not finite. With several outputs, return a mapping from their
        names to their values.

        With `time`, the inputs are samples of one recording. Rates and directions are then computed
        from these samples, and a model with memory predicts the samples one after the other. If it
        needs earlier samples, its output is NaN at the first samples. Warns (UserWarning) if points
        lie outside the training range. Raises `TypeError` for a missing or unknown input.
        """
        flat, shape = self._flattened(columns)
        outside = int(outside_range(self.model, flat).sum())
        if outside:
            warnings.warn(
                f"{outside} of {prod(shape)} point(s) lie outside the training range of "
                f"{self.model.name}",
                stacklevel=2,
            )
        outputs = {
            model.output.name: predict(model, flat).reshape(shape) for model in self.model.each
        }
        return outputs if len(outputs) > 1 else outputs[self.output.name]

    def predict(self, frame: object, columns: Mapping[str, Any] | None = None) -> Any:
        """Return the output at each row of a table, shape (n,), in the unit of the model.

        The output is NaN if an input is not finite. A model of several outputs returns a mapping.
        `columns` has the same form as in `fit` (name, unit, scale, offset). A model that was made
        by `fit` already knows the columns of its training data. All other columns must have the
        names of the quantities, and numbers in the model's units. For a model with memory, the rows
        are one recording.

        Raises
        ------
        DataError
            The table has no column for an input.
        """
        sources = self._sources
        if columns is not None:
            sources = _SOURCES.validate_python(
                {name: {**entry, "column": source_of(entry)} for name, entry in columns.items()}
            )
        known = {name for name, source in sources.items() if columns_in(frame, source.column)}
        known |= {*map(str, labels_of(frame) or ())}
        signals = {signal.name for signal in self.model.signals}
        reading = reading_of(self.model, known if "time" in known else known | signals)
        wanted = tuple(dict.fromkeys((*reading.columns, *reading.outputs)))
        return self(**quantities_of(frame, wanted, sources, self.units))

    @property
    def _sources(self) -> Mapping[str, SourceColumn]:
        return {}

    def export(self, to: str, path: str | Path = ".", **options: object) -> list[Path]:
        """Write the model in another language, as `mapmore export --to` does, into the folder
        `path`, and return the paths of the files.

        The keyword arguments in `options` may be `single` (True for single precision), `grid` (the
        points of a lookup table) and `verify` (False to skip the comparison with `predict`). Raises
        `UsageError`, `DataError` or `WriteError` as the command does.
        """
        exported = plugins.load("python", "export")(
            self.model, to, warn=lambda message: warnings.warn(message, stacklevel=4), **options
        )
        return write_chosen(Path(path), exported)

    def plot(self, ax: Axes | None = None, interval: float | None = None) -> Axes:
        """Draw the model over its training range, on `ax` or on a new figure.

        Each training curve is drawn as a line, the held-out samples as dots, and the model as a
        dashed line. With `interval=0.95`, bands are drawn that contain a sample of a new curve with
        a probability of 95 %. If the spec has `validate: {intervals: true}`, these bands are always
        drawn. Raises `DataError` in the same cases as `interval`, and `TypeError` for a model with
        memory. To draw such a model, call it with a recording and draw the result.
        """
        if ax is None:
            import matplotlib.pyplot as plt

            ax = plt.figure(layout="constrained").subplots()
        # imported here, because it loads matplotlib
        from mapmore_cli.reporting.figures.commands import draw_model

        if interval is None and self.model.left_out is not None:
            interval = INTERVAL
        model = alone(self.model) if interval is None else self._with_intervals
        draw_model(ax, model, interval, self.held_out)
        return ax

    @property
    def _with_intervals(self) -> Model:
        return self.model

    def outside_range(self, **columns: ArrayLike) -> BoolArray:
        """Return an array in the shape of the output. It is True at points at which an input lies
        outside its training range.
        """
        flat, shape = self._flattened(columns)
        return outside_range(self.model, flat).reshape(shape)

    def interval(self, level: float = 0.95, **columns: ArrayLike) -> tuple[Array, Array]:
        """Return the lower and the upper end of an interval, both in the shape of the output. A
        sample of a new curve lies in the interval with the probability `level`. Outside the
        training range, both ends are NaN.

        For an interval, the model is fitted several times, each time without one part of the
        training data. With `validate: {intervals: true}` in the spec, these fits are made together
        with the model. Without this key, a model from `fit` makes them when `interval` is called,
        which takes time. If the model is read from a file without these fits, `DataError` is
        raised.
        """
        flat, shape = self._flattened(columns)
        low, high = interval(self._with_intervals, flat, level)
        return low.reshape(shape), high.reshape(shape)

    def derivatives(self, **columns: ArrayLike) -> dict[str, Array]:
        """Return the derivatives of the output with respect to each input, in the shape of the
        output. Raises an error for a model with memory, because it has no such derivatives.
        """
        flat, shape = self._flattened(columns)
        return {name: slope.reshape(shape) for name, slope in slopes(self.model, flat).items()}

    def invert(
        self, name: str, wanted: ArrayLike | None = None, rule: str = LOWEST, **given: ArrayLike
    ) -> Inverse:
        """Return, for each row, all values of the input `name` for which the model predicts the
        `wanted` output. The other inputs have the `given` values of the row.

        Values are searched between the smallest and the largest value of this input in the training
        data. In combination with the other inputs, such a value can still be outside the measured
        data: see `outside_range`.

        The wanted output may be passed by its name: `invert("pressure", force=100, strain=0.1)`.
        `rule` selects one of several solutions: `lowest` selects the lowest one, and `nearest`
        selects the one that is nearest to the selected solution of the previous row. Models with
        memory cannot be inverted.
        """
        if wanted is None:
            if self.output.name not in given:
                raise TypeError(f"the wanted output is missing: give `{self.output.name}`")
            wanted = given.pop(self.output.name)
        arrays = [
            self._given(self.output.name, wanted),
            *(self._given(key, values) for key, values in given.items()),
        ]
        target, *others = (array.ravel() for array in np.broadcast_arrays(*arrays))
        return invert(self.model, target, dict(zip(given, others, strict=True)), name, rule)

    def _given(self, name: str, values: object) -> Array:
        return given_numbers(values, f"`{name}`", name, self.units.get(name) or default_unit(name))

    def _flattened(self, columns: dict[str, ArrayLike]) -> tuple[dict[str, Array], tuple[int, ...]]:
        signals = self.model.signals
        # these inputs are allowed, but are not needed if the rates and directions themselves are
        # passed
        spare = {"time", *(signal.of for signal in signals)} if signals else set[str]()
        known = (
            {*columns} if "time" in columns else {*columns, *(signal.name for signal in signals)}
        )
        reading = reading_of(self.model, known)
        needed = list(dict.fromkeys(reading.columns + reading.outputs))
        if not {*needed} <= {*columns} <= {*needed, *spare}:
            raise TypeError(
                f"this model is a function of {', '.join(needed)}; got "
                f"{', '.join(columns) or 'nothing'}"
            )
        arrays = np.broadcast_arrays(*(self._given(name, columns[name]) for name in needed))
        flat = {name: array.ravel() for name, array in zip(needed, arrays, strict=True)}
        return with_signals(reading.signals, flat), arrays[0].shape


_SOURCES = TypeAdapter(dict[str, SourceColumn])
