"""Use models and tables in notebooks and scripts: a model as a function, and tables in memory
(mappings of arrays, data frames) instead of files.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import prod
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from numpy.typing import ArrayLike
from pydantic import TypeAdapter

from mapmore_cli.domain import plugins
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.models import Equation, Model
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.inverse import LOWEST, Inverse, invert
from mapmore_cli.modelling.kinds import alone, outside_range, predict
from mapmore_cli.modelling.kinds import equations as model_equations
from mapmore_cli.modelling.programs import slopes
from mapmore_cli.modelling.signals.rates import with_signals
from mapmore_cli.modelling.validation.intervals import INTERVAL, interval
from mapmore_cli.pipeline.frames import Door, labels_of
from mapmore_cli.pipeline.records import reading_of
from mapmore_cli.storage.atomic import make_folder, refusals_told, replacing, write_own
from mapmore_cli.storage.tables import IN_MEMORY, RawTable, known_names
from mapmore_cli.storage.tables.cells import CellReader
from mapmore_cli.study.fields import as_target
from mapmore_cli.study.sections.logs import SourceColumn
from mapmore_cli.study.units import convert, default_unit, is_canonical

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class LoadedModel:
    """A model as a function with one keyword for every input, in the model's units. With `time`,
    rates and directions may be left out.

    A model with memory takes one recording: its `time` in s, and the measured output if the model
    feeds its output back. A model of several outputs returns a mapping by their names; `of` returns
    the model of one output.

    Examples
    --------
    >>> model = load_model("runs/dmsp-20-88-static/model.h5")  # doctest: +SKIP
    >>> model(pressure=[100.0, 200.0], strain=0.1)             # doctest: +SKIP
    array([112.3, 271.9])
    """

    model: Model
    scores: Sequence[Mapping[str, Any]] = ()  # rows of the scores.json beside the model file
    held_out: tuple[Curve, ...] = field(default=(), kw_only=True)

    def __repr__(self) -> str:
        """Return a line with the predicted quantity and the inputs."""
        inputs = ", ".join(quantity.label for quantity in self.inputs) or "its own past"
        outputs = ", ".join(output.label for output in self.model.outputs)
        return f"<model {self.model.name}: {outputs} of {inputs}>"

    def of(self, output: str) -> Self:
        """Return the model of one of several outputs. Raises TypeError for an unknown output."""
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
        """Name and unit of the predicted quantity; with several outputs, of the first."""
        return self.model.output

    @property
    def equations(self) -> tuple[Equation, ...]:
        """The model in physical units, as text and LaTeX."""
        return model_equations(self.model)

    def __call__(self, **columns: ArrayLike) -> Any:
        """Return the output at the inputs, which are broadcast against each other; NaN if an input
        is not finite. With several outputs, return a mapping by their names.

        With `time`, the inputs are samples of one recording, from which the model's rates and
        directions are computed, and along which a model with memory runs (NaN before there is
        history). Warns (UserWarning) if points lie outside the training range. Raises `TypeError`
        for a missing or unknown input.
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
        `columns` has the form that it has in `fit` (name, unit, scale, offset). A model that comes
        from `fit` already knows the columns of its training data. All other columns must have the
        names and units of the quantities. For a model with memory, the rows are one recording.

        Raises
        ------
        DataError
            If an input has no column.
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

        `options` are `single`, `grid` and `verify`. Raises `UsageError`, `DataError` or
        `WriteError` as the command does.
        """
        folder = Path(path)
        exported = plugins.load("python", "export")(
            self.model, to, warn=lambda message: warnings.warn(message, stacklevel=4), **options
        )
        with refusals_told(folder):
            folder.mkdir(parents=True, exist_ok=True)
        for name, content in exported.items():
            write_own(folder / name, content)
        return [folder / name for name in exported]

    def plot(self, ax: Axes | None = None, interval: float | None = None) -> Axes:
        """Draw the model over its training range, on `ax` or on a new figure.

        Each training curve is a line. Held-out samples are dots, with the model as a dashed line.
        With `interval=0.95`, bands contain a sample of a new curve with a probability of 95 %; they
        are also drawn if the spec has `validate: {intervals: true}`. Raises `TypeError` for a model
        with memory (call it with a recording and draw the result), and `DataError` as `interval`
        does.
        """
        if ax is None:
            import matplotlib.pyplot as plt

            ax = plt.figure(layout="constrained").subplots()
        # imported here because it loads matplotlib
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
        """Return True for points at which an input lies outside the training range, in the shape of
        the output.
        """
        flat, shape = self._flattened(columns)
        return outside_range(self.model, flat).reshape(shape)

    def interval(self, level: float = 0.95, **columns: ArrayLike) -> tuple[Array, Array]:
        """Return the lower and the upper end of the interval that contains a sample of a new curve
        with the probability `level`, in the shape of the output.

        They are NaN outside the training range. They need fits without each part of the training
        data, which a spec with `validate: {intervals: true}` makes. Without this key, a model from
        `fit` makes these fits now, which takes time, and a model from a file raises `DataError`.
        """
        flat, shape = self._flattened(columns)
        low, high = interval(self._with_intervals, flat, level)
        return low.reshape(shape), high.reshape(shape)

    def derivatives(self, **columns: ArrayLike) -> dict[str, Array]:
        """Return the derivative of the output by each input, in the shape of the output. Raises an
        error for models with memory, which have none.
        """
        flat, shape = self._flattened(columns)
        return {name: slope.reshape(shape) for name, slope in slopes(self.model, flat).items()}

    def invert(
        self, name: str, wanted: ArrayLike | None = None, rule: str = LOWEST, **given: ArrayLike
    ) -> Inverse:
        """Return every value of the input `name` that gives the `wanted` output at the other
        inputs, row by row.

        Values are searched between the smallest and the largest one of the training data. At the
        other inputs, such a value can be outside of the measured data: see `outside_range`.

        The wanted output may be passed by its name: `invert("pressure", force=100, strain=0.1)`.
        The rule `lowest` picks the lowest solution, `nearest` the one nearest to the solution of
        the row before. Models with memory cannot be inverted.
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
        # quantities from which the rates and directions that were passed could be computed; they
        # are not needed
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


# Tables
# --------------------------------------------------------------------------------------------------

Column = str | int

Frame = Any
"""Any table: a mapping of arrays, or a data frame of pandas, polars or pyarrow."""

Entry = Column | Mapping[str, Any]
"""Entry of `columns` for a quantity, as in YAML."""


def columns_in(frame: object, column: Column) -> list[Hashable]:
    """Return the labels that a column of the spec means: none if there is no such column, several
    if it is ambiguous.

    The identical label is preferred. A text also means a label that is written like it. A number
    means an index, counted from 0, if no label is a number.
    """
    labels = labels_of(frame) or ()
    exact: list[Hashable] = [
        label for label in labels if type(label) is not bool and label == column
    ]
    if isinstance(column, str):
        return exact or [label for label in labels if str(label) == column]
    numbered = any(isinstance(label, Integral) for label in labels)
    return exact if numbered or not 0 <= column < len(labels) else [labels[column]]


def canonical_columns(frame: object, target: object) -> dict[str, dict[str, str]]:
    """Return the section `columns` for a frame: its columns with canonical names; or, if the
    `target` is the label of a column, all columns whose labels can be names of quantities. Raises
    SpecError if there are none.
    """
    names = tuple(map(str, labels_of(frame) or ()))
    section = as_target(target)
    is_own = isinstance(section, dict) and section.get("column") in names
    usable = filter(str.isidentifier if is_own else is_canonical, names)
    columns = {name: {"column": name} for name in usable}
    if not columns:
        known = known_names("", names, "The frame has")
        raise SpecError(
            "columns: no column of the frame has a canonical name",
            f'assign the columns: columns={{"force": {{"column": "F"}}}}. {known}',
        )
    return columns


def with_canonical_columns(
    frames: Sequence[object], columns: Mapping[str, Any], made: Collection[str]
) -> dict[str, Any]:
    """Return the section `columns`, extended by unused columns of all frames whose labels are
    canonical names, except quantities that are already in the section, or that are `made` from
    others (derived).
    """
    frame, *others = frames
    used = {label for entry in columns.values() for label in columns_in(frame, source_of(entry))}
    added = {
        str(label): {"column": str(label)}
        for label in labels_of(frame) or ()
        if label not in used
        and str(label) not in made
        and is_canonical(str(label))
        and all(label in (labels_of(other) or ()) for other in others)
    }
    return {**added, **columns}


def column_of(
    frame: Frame, column: Column, label: str, name: str, unit: str, layout: str | None = None
) -> Array:
    """Return one column as numbers of the quantity `name` in a `unit`, (n,). Raises DataError."""
    labels, matches, label_of_column = (
        labels_of(frame) or (),
        columns_in(frame, column),
        f"{label}: column '{column}'",
    )
    if not matches:
        known = known_names(str(column), tuple(map(str, labels)), "The frame has")
        raise DataError(f"{label}: there is no column '{column}'", known)
    if len(matches) > 1 or labels.count(matches[0]) > 1:
        raise DataError(
            f"{label_of_column} exists more than once", "give each column a name of its own"
        )
    values = given_numbers(frame[matches[0]], label_of_column, name, unit, layout)
    if values.ndim != 1:
        raise DataError(
            f"{label_of_column} has the shape {values.shape}",
            "give one-dimensional arrays of one length",
        )
    return values


def given_numbers(
    values: object, what: str, name: str, unit: str, layout: str | None = None
) -> Array:
    """Return the values that a user passed for the quantity `name` as numbers in a `unit`; `layout`
    is the format of time stamps.

    Raises DataError with a message that begins with `what`, a name for the values.
    """
    clock = name == "time"
    read = CellReader(clock=clock, format=layout, second=convert(1.0, "s", unit) if clock else 1.0)
    return Door(
        lambda numbers, unit_of_column: convert(numbers, unit_of_column, unit), read, clock
    ).numbers(values, what)


def tables_of(
    frames: Sequence[Frame], columns: Mapping[str, Entry], units: Mapping[str, str]
) -> dict[str, RawTable]:
    """Return every frame as a recording in memory: one unscaled array, (n,), for each quantity of
    `columns`. `columns` and `units` are sections of the spec.

    Raises `DataError` for columns that do not exist, are no numbers, or differ in length.
    """
    tables = {}
    titles = {name: repr(source_of(entry)) for name, entry in columns.items()}
    for number, frame in enumerate(frames, start=1):
        label = f"frame {number}" if len(frames) > 1 else "the frame"
        arrays = {}
        for name, entry in columns.items():
            settings = entry if isinstance(entry, Mapping) else {}
            unit = str(settings.get("unit") or default_unit(name, units))
            own = column_of(
                frame, source_of(entry), label, name, unit, settings.get("format")
            ).view()
            # the array may belong to the caller, so it must not be changed
            own.flags.writeable = False
            arrays[name] = own
        lengths = {name: len(values) for name, values in arrays.items()}
        if len(set(lengths.values())) > 1:
            raise DataError(
                f"{label}: columns of different length: {lengths}",
                "give columns of one recording, which all have the same length",
            )
        rows = range(max(lengths.values(), default=0))
        tables[f"recording_{number}"] = RawTable(arrays, rows, label, IN_MEMORY, titles=titles)
    return tables


def section_of(tables: Iterable[str], columns: Mapping[str, Entry]) -> dict[str, object]:
    """Return the keys of `data` for tables in memory, whose columns have the names of their
    quantities; `columns` is the section for the frames.
    """
    read = {}
    for name, entry in columns.items():
        read[name] = {**(entry if isinstance(entry, Mapping) else {}), "column": name}
        if name == "time":
            # the arrays already contain numbers instead of time stamps
            read[name].pop("format", None)
    return {"files": [*tables], "reader": "hdf5", "columns": read}


def write_tables(tables: Mapping[str, RawTable], folder: Path) -> list[Path]:
    """Write every table in memory to a separate HDF5 file in `folder`, and return their paths."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    make_folder(folder)
    paths = [folder / f"{name}.h5" for name in tables]
    for path, table in zip(paths, tables.values(), strict=True):
        with replacing(path) as raw, h5py.File(raw, "w") as file:
            for name, values in table.columns.items():
                file.create_dataset(name, data=values, track_times=False)
    return paths


def source_of(entry: object) -> Column:
    """Return the column that an entry of `columns` names. Raises SpecError for an entry of another
    form.
    """
    source = entry.get("column") if isinstance(entry, Mapping) else entry
    if not isinstance(source, str | int):
        raise SpecError(
            "columns: an entry does not name its column",
            'write columns={"force": {"column": "F", "unit": "N"}}',
        )
    return source


def quantities_of(
    frame: object,
    wanted: Sequence[str],
    columns: Mapping[str, SourceColumn],
    units: Mapping[str, str],
) -> dict[str, Array]:
    """Return the `wanted` quantities of a frame in the model's `units`, (n,) each.

    A column is found by its name in `columns`, with unit, scale and offset; otherwise by its
    canonical name, in the model's unit; otherwise by its index in `columns`.
    """
    values_of = {}
    for name in wanted:
        column, unit = columns.get(name), units.get(name) or default_unit(name)
        numbered = (
            column is not None and isinstance(column.column, int) and not columns_in(frame, name)
        )
        if column is not None and (numbered or columns_in(frame, str(column.column))):
            own = column.unit or unit
            values = column_of(
                frame, column.column, "the frame", name, own, column.formats.get(column.column)
            )
            values = values * column.scale + column.offset
            values_of[name] = convert(values, own, unit)
        else:
            values_of[name] = column_of(frame, name, "the frame", name, unit)
    return values_of


def plain_values(section: Mapping[str, object]) -> dict[str, Any]:
    """Return a section in the types of YAML: lists for tuples and arrays, numbers for NumPy
    scalars, text for paths.
    """
    return {str(key): _plain_value(value) for key, value in section.items()}


def _plain_value(value: object) -> object:
    if isinstance(value, Mapping):
        return plain_values(value)
    if isinstance(value, list | tuple):
        return [_plain_value(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value
