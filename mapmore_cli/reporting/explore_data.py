"""Prepare numbers and texts for the section "Explore" of a page: quantities, sliders, samples, a
recording, and intervals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, Ends, IntArray
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.kinds import fed_back
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.modelling.validation.intervals import INTERVAL, half_widths_of, interval_limits
from mapmore_cli.reporting.inputs import FigureStyle, ReportInputs
from mapmore_cli.reporting.scripts import json_text

MOST_TRAINED, MOST_SAMPLES = 2000, 4000
"""Largest number of training samples and of held-out samples of an output on its page. Training
samples are only drawn. From held-out samples, the page also computes errors.
"""

PLACES = 41
"""Number of levels at which a page holds the width of intervals."""

BEYOND = 0.15
"""Fraction of the training range of an input by which its slider goes beyond each end."""

NEAR = 0.06
"""A page draws samples over one input. It shows a sample if each of the other inputs differs from
the value of its slider by at most this fraction of the training range of the input.
"""

PER_PERIOD, REST, MOST_RESTING = 500, 30.0, 20_000
"""Number of samples in one period of the input that a page shows at first; time in seconds for
which a model is simulated with constant inputs, so that it comes to rest; and largest number of
samples in this time.
"""


def study_of(inputs: ReportInputs, key: str) -> dict[str, Any]:
    """Return the data of one output for the section "Explore". `key` is the name under which the
    page finds the model. A model with memory gets a recording, every other model gets samples.
    """
    model, curves = inputs.model, inputs.dataset.curves
    spans = {quantity.name: _span(curves, quantity.name) for quantity in model.inputs}
    signals = {
        signal.name: {
            "kind": signal.kind,
            "of": signal.of,
            "factor": signal.factor * signal.seconds,
        }
        for signal in model.signals
    }
    along = inputs.along if inputs.along in model.inputs else next(iter(model.inputs), None)
    study = {
        "key": key,
        "inputs": [
            _quantity(quantity, inputs) | _reach(*spans[quantity.name]) for quantity in model.inputs
        ],
        "output": _quantity(model.output, inputs),
        "along": along.name if along else "",
        "memory": inputs.has_memory,
        "signals": signals,
        "interval": _interval(inputs),
        "no_interval": _no_interval(inputs),
    }
    if not inputs.has_memory:
        return study | _samples(inputs, spans)
    driven = {name: spans[name] for name in spans if name not in signals and name != "time"}
    record = _record(inputs, curves)
    knobs = {
        name: [_knob_of_input(name, span, sum(span) / 2), _swing(name, span[1] - span[0])]
        for name, span in driven.items()
    }
    rate = 1 / (PER_PERIOD * record["step"])
    frequency = _knob("frequency", (rate / 20, rate * 5), rate)
    return study | {"record": record, "knobs": knobs, "frequency": frequency}


def _span(curves: Sequence[Curve], name: str) -> Ends:
    """Return the smallest and the largest value of a quantity, or 0 and 1 if all its values are
    missing.
    """
    values = np.concatenate([curve.columns[name] for curve in curves])
    values = values[np.isfinite(values)]
    return (values.min(), values.max()) if values.size else (0.0, 1.0)


def _quantity(quantity: Quantity, inputs: ReportInputs) -> dict[str, str]:
    """Return the name, title, unit and label of a quantity for the page. If a label of the user
    contains a formula, the default label is returned, because the script cannot typeset formulas.
    """
    label = inputs.axis_label(quantity)
    return {
        "name": quantity.name,
        "title": quantity.name.replace("_", " "),
        "unit": "" if quantity.unit in ("", "1") else quantity.unit,
        "label": FigureStyle().axis_label(quantity) if "$" in label else label,
    }


def _reach(low: float, high: float) -> dict[str, Any]:
    """Return the ends of the slider of an input, which lie beyond its training range. Also return
    the largest distance from the value of the slider at which the page still shows a sample.
    """
    width = high - low or abs(low) or 1.0
    return {
        "ends": _numbers(np.array([low - BEYOND * width, high + BEYOND * width])),
        "near": NEAR * (high - low) + 1e-12,
    }


def _knob(name: str, ends: Sequence[float], value: float) -> dict[str, Any]:
    """Return the data of a slider and its number field: name, ends, step, and value at the
    start.
    """
    step = float(f"{(ends[1] - ends[0]) / 500:.2g}")
    low, high, start = _numbers(np.array([*ends, value]))
    return {"name": name, "low": low, "high": high, "step": step, "value": start}


def _knob_of_input(name: str, span: Ends, value: float) -> dict[str, Any]:
    """Return the slider of an input, which goes beyond its training range."""
    return _knob(f"input:{name}", _reach(*span)["ends"], value)


def _swing(name: str, width: float) -> dict[str, Any]:
    """Return the slider for the amplitude with which an input varies over time."""
    width = width or 1.0
    return _knob(f"amplitude:{name}", (0.0, 0.65 * width), 0.4 * width)


def _numbers(values: Array) -> list[float | None]:
    """Round numbers to seven significant digits. A missing number becomes None."""
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values.tolist()]


def _samples(inputs: ReportInputs, spans: Mapping[str, Ends]) -> dict[str, Any]:
    """Return three groups of data for the page of a model without memory:

    - `samples`: at most `MOST_TRAINED` training samples and `MOST_SAMPLES` held-out samples, evenly
      thinned.
    - `buttons`: for each button, the input values to which it sets the sliders.
    - `knobs`: the sliders of the inputs in `spans`. They start at the middle sample of the first
      held-out curve. Without held-out curves, they start in the middle of their ranges.
    """
    kept = [*spans, inputs.model.output.name]
    pooled = np.array([inputs.pooled(name) for name in kept])
    known, held = np.isfinite(pooled).all(axis=0), inputs.pooled_held_out
    parts = [np.flatnonzero(known & (held == part)) for part in (False, True)]

    def thinned(rows: IntArray, most: int) -> dict[str, list[float | None]]:
        columns = pooled[:, rows[:: max(1, -(-len(rows) // most))]]
        return dict(zip(kept, map(_numbers, columns), strict=True))

    ends = np.cumsum([curve.size for curve in inputs.dataset.curves])
    groups = np.split(parts[1], np.searchsorted(parts[1], ends))
    places = inputs.pooled(inputs.along.name)
    middles = [middle_of(rows, places[rows]) for rows in groups if len(rows)]
    shown = parts[1] if middles else parts[0]
    errors = np.nan_to_num(np.abs(inputs.errors_of(inputs.own)[shown]), nan=-np.inf)
    worst = "Worst held-out sample" if middles else "Worst sample"
    buttons = {"Held-out curve": middles[1:] + middles[:1], worst: [shown[np.argmax(errors)]]}
    start = pooled[:-1, middles[0]] if middles else map(np.mean, spans.values())
    knobs = {
        name: [_knob_of_input(name, spans[name], value)]
        for name, value in zip(spans, start, strict=True)
    }
    return {
        "samples": {
            "trained": thinned(parts[0], MOST_TRAINED),
            "held": thinned(parts[1], MOST_SAMPLES),
            "all_held": int(held.sum()),
        },
        "buttons": {
            title: json_text([_numbers(pooled[:-1, row]) for row in rows])
            for title, rows in buttons.items()
            if len(rows)
        },
        "knobs": knobs,
    }


def middle_of(rows: IntArray, places: Array) -> int:
    """Return the row of a curve at which the varying quantity has its median value. `places`, (n,),
    are the values of this quantity at the `rows`.

    The median is used and not the middle row, because the middle row of a loading cycle lies at the
    turning point, at an end of the range.
    """
    return int(rows[np.argsort(places, kind="stable")[len(rows) // 2]])


def _record(inputs: ReportInputs, curves: Sequence[Curve]) -> dict[str, Any]:
    """Return a part of a curve, linearly interpolated to the time steps of the model, and a
    sentence about the initial values of the simulation. The part begins at the first held-out
    sample of the first curve that has held-out samples. If nothing is held out, it is the beginning
    of the first curve.
    """
    model, output = inputs.model, inputs.model.output.name
    curve = next((curve for curve in curves if curve.held_out.any()), curves[0])
    start = int(np.argmax(curve.held_out))  # this is 0 if no sample is held out
    columns = {name: column[start:] for name, column in curve.columns.items()}
    time, step = columns["time"], program_of(model).step
    assert step is not None  # every model with memory has a time step
    count = min(MOST_SAMPLES, int((time[-1] - time[0]) / step + 1.5))
    grid = np.minimum(time[0] + step * np.arange(count), time[-1])
    known = columns[output][np.isfinite(columns[output])]
    rest = min(MOST_RESTING, round(REST / step))
    names = [quantity.name for quantity in model.inputs]
    return {
        "name": f"{curve.id}{', held out' if curve.held_out.any() else ''}",
        "columns": {
            name: _numbers(np.interp(grid, time, columns[name])) for name in (*names, output)
        },
        "start": _numbers(known[:1])[0] if known.size else 0.0,
        "step": step,
        "rest": rest,
        "at_rest": f"at rest after {rest * step:.3g} s at the offset",
        "begins": _begins(inputs),
    }


def _begins(inputs: ReportInputs) -> str:
    """Return a sentence that says with which initial values simulations by the model and by its
    competitors begin.
    """
    output = inputs.model.output.name.replace("_", " ")
    measured = (
        f"begins with as many values of {output} as it needs of the past: those measured at the "
        "beginning of the recording, or, in a course of your own, the first of them again and "
        "again."
    )
    if fed_back(inputs.model):
        return f"A run {measured}"
    others = any(map(fed_back, inputs.validation.models.values()))
    more = f" A competitor that feeds {output} back {measured}" if others else ""
    return f"A run of the model begins at rest, without measured {output}.{more}"


def _interval(inputs: ReportInputs) -> dict[str, Any] | None:
    """Return half the width of the prediction interval at evenly spaced values of the level
    quantity; None if the study has no intervals.
    """
    if inputs.left_out is None:
        return None
    level = inputs.model.level
    ends = _span(inputs.dataset.curves, level) if level else (0.0, 0.0)
    at = np.linspace(*ends, PLACES)
    half = half_widths_of(inputs.model, {level or "row": at}, INTERVAL)
    of = level if at[-1] > at[0] else None
    low, step = at[0], (at[-1] - at[0]) / (PLACES - 1)
    return {"of": of, "low": low, "step": step, "half": _numbers(half), "level": INTERVAL}


def _no_interval(inputs: ReportInputs) -> str:
    """Return a sentence that says why there is no interval, or which errors the interval does not
    include. Return an empty text if the interval is complete.
    """
    if inputs.left_out is not None:
        limits = interval_limits(inputs.left_out)
        return f"About the interval: {limits}." if limits else ""
    if inputs.turned:
        return "There is no interval: the study scores another quantity."
    return "There is no interval: the spec does not ask for one (validate: {intervals: true})."
