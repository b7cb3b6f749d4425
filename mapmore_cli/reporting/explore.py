"""Prepare the data with which a page computes its models: their code in JavaScript, and samples.

The code comes from the annex that exports models; without it, a page has no section "Explore".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mapmore_cli.domain import plugins
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.modelling.validation.intervals import INTERVAL, half_widths_of, interval_limits
from mapmore_cli.reporting.competitors import is_known
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.scripts import json_text
from mapmore_cli.reporting.table import title_of

MOST_SAMPLES = 4000
"""Largest number of training samples, and of held-out samples, of an output on its page."""

PLACES = 41
"""Number of levels for which a page contains the width of intervals."""

_EXPORTED = re.compile(r"\nexport \{ (.*) \};\n$")


@dataclass(frozen=True)
class Explored:
    """The section "Explore" of a page.

    - `outputs`: data of each output for its script, ready for JSON; None if the model of the output
      has no closed expression.
    - `code`: a script that stores every model in `mapmore.models`, by the names in `outputs`.
    """

    outputs: tuple[dict[str, Any] | None, ...]
    code: str


def explored(every: Sequence[ReportInputs]) -> Explored | None:
    """Return the data for the pages of these outputs; None if nothing can be computed, or if the
    exporting annex is missing.
    """
    try:
        plugins.load("python", "export")
    except plugins.NotInstalled:
        return None
    code: dict[str, str] = {}

    def module(key: str, model: Model, more: str = "") -> bool:
        """Store the code of a model; return True if there is any."""
        try:
            code[key] = wrapped(key, model, more)
        except MapmoreError:  # a part of the model has no closed expression
            return False
        return True

    outputs: list[dict[str, Any] | None] = []
    for number, inputs in enumerate(every):
        key = f"model{number}"
        if not module(key, inputs.model):
            outputs.append(None)
            continue
        others = [
            {"key": f"{key}.{place}", "title": title_of(name)}
            for place, (name, other) in enumerate(_competitors(inputs).items())
            if module(f"{key}.{place}", other)
        ]
        known = _known(inputs, key) | {"others": others}
        pieces = inputs.model.pieces
        if pieces is not None and pieces.segments:
            bare, more = bare_of(inputs.model)
            if module(f"{key}.pieces", bare, more):
                texts = {one.id: one.text for one in inputs.equations}
                known["pieces"] = pieces_of(pieces, texts) | {"key": f"{key}.pieces"}
        outputs.append(known)
    if not code:
        return None
    return Explored(tuple(outputs), '"use strict";\n' + "".join(code.values()))


def wrapped(key: str, model: Model, more: str = "") -> str:
    """Return the exported JavaScript module of a model as a function that calls itself, because a
    page cannot import modules. Its result is `mapmore.models[key]`, which also holds `more`.

    Raises DataError if a part of the model has no closed expression.
    """
    (text,) = plugins.load("python", "export")(model, "js", verify=False).values()
    inside = _EXPORTED.sub(rf"\nreturn {{ \1{more} }};\n", text.decode())
    return f"mapmore.models[{json_text(key)}] = (() => {{\n{inside}}})();\n"


def _competitors(inputs: ReportInputs) -> dict[str, Model]:
    """Return the competitors that the page can compute as well as its model: they predict the same
    quantity from its inputs, and, if they have memory, have its time step.
    """
    model = inputs.model
    known, steps = {one.name for one in model.inputs}, _steps(model)
    return {
        name: one
        for name, one in inputs.validation.models.items()
        if name in inputs.models
        and one.output == model.output
        and is_known(one)
        and {quantity.name for quantity in one.inputs} <= known
        and _steps(one) <= steps
    }


def _steps(model: Model) -> set[float]:
    """Return the times between samples of the parts of a model with memory, s; an empty set if it
    has no memory.
    """
    return {memory.states.step for memory in model.memories}


def _known(inputs: ReportInputs, key: str) -> dict[str, Any]:
    """Return the data that the script of a page needs for every kind of model."""
    model, timed = inputs.model, inputs.has_memory
    curves = inputs.dataset.curves
    names = [quantity.name for quantity in model.inputs]
    kept = [*names, *(["time"] if timed else []), model.output.name]
    return {
        "key": key,
        "name": model.name,
        "inputs": [_quantity(one) for one in model.inputs],
        "output": _quantity(model.output),
        "along": names.index(inputs.along.name) if inputs.along.name in names else 0,
        "memory": timed,
        "spans": {name: _numbers(np.array(_span(curves, name))) for name in names},
        "signals": {
            one.name: {"kind": one.kind, "of": one.of, "factor": one.factor * one.seconds}
            for one in model.signals
        },
        "samples": _recording(curves, kept) if timed else _samples(inputs, curves, kept),
        "interval": _interval(inputs),
        "no_interval": _no_interval(inputs),
    }


def _span(curves: Sequence[Curve], name: str) -> tuple[float, float]:
    """Return the smallest and largest value of a quantity; 0 and 1 if it has none."""
    values = np.concatenate([curve.columns[name] for curve in curves])
    values = values[np.isfinite(values)]
    return (values.min(), values.max()) if values.size else (0.0, 1.0)


def _quantity(one: Quantity) -> dict[str, str]:
    return {"name": one.name, "unit": "" if one.unit in ("", "1") else one.unit}


def _numbers(values: Array) -> list[float | None]:
    """Return numbers with seven digits; null for a missing number."""
    return [float(f"{one:.7g}") if np.isfinite(one) else None for one in values.tolist()]


def _samples(inputs: ReportInputs, curves: Sequence[Curve], names: Sequence[str]) -> dict[str, Any]:
    """Return columns of training samples and of held-out samples, each evenly thinned to
    `MOST_SAMPLES`, with the names of their curves and the numbers of samples before thinning.
    """
    held = inputs.pooled_held_out
    parts = [np.flatnonzero(held == part) for part in (False, True)]
    thin = [rows[:: max(1, -(-len(rows) // MOST_SAMPLES))] for rows in parts]
    rows = np.sort(np.concatenate(thin))
    numbers = np.repeat(np.arange(len(curves)), [len(one.held_out) for one in curves])
    return {
        "columns": {name: _numbers(inputs.pooled(name)[rows]) for name in names},
        "held": held[rows].astype(int).tolist(),
        "curve": numbers[rows].tolist(),
        "curves": [inputs.curve_label(one) for one in curves],
        "all_held": len(parts[1]),
    }


def _recording(curves: Sequence[Curve], names: Sequence[str]) -> dict[str, Any]:
    """Return the beginning of one recording, if possible a held-out one."""
    curve = next((one for one in curves if one.held_out.any()), curves[0])
    start = int(np.argmax(curve.held_out)) if curve.held_out.any() else 0
    rows = slice(start, start + MOST_SAMPLES)
    return {
        "columns": {name: _numbers(curve.columns[name][rows]) for name in names},
        "held": bool(curve.held_out.any()),
        "name": curve.id,
    }


def _interval(inputs: ReportInputs) -> dict[str, Any] | None:
    """Return half the width of intervals at levels; None if the study has no intervals."""
    if inputs.left_out is None:
        return None
    level = inputs.model.level
    if level is None:
        at = np.zeros(1)
    else:
        low, high = np.min(inputs.pooled(level)), np.max(inputs.pooled(level))
        at = np.linspace(low, high, PLACES)
    half = half_widths_of(inputs.model, {level or "row": at}, INTERVAL)
    return {"of": level, "at": _numbers(at), "half": _numbers(half), "level": INTERVAL}


def _no_interval(inputs: ReportInputs) -> str:
    """Return a sentence on why there is no interval, or on what it does not contain; empty if the
    interval is complete.
    """
    if inputs.left_out is not None:
        limits = interval_limits(inputs.left_out)
        return f"About the interval: {limits}." if limits else ""
    if inputs.turned:
        return "There is no interval: the study scores another quantity."
    return "There is no interval: the spec does not ask for one (validate: {intervals: true})."


def bare_of(model: Model) -> tuple[Model, str]:
    """Return what a page needs to join the pieces of a model in other ways. The first result is the
    model without limits of its segment functions outside their samples. The second is JavaScript
    code that gives access to its curves and segments with their slopes.

    `rejoin` replaces the functions of the curves.
    """
    body = model.body_of(Pieces)
    free = [one.name for one in model.inputs if one.name != body.level]
    kept = {name: sides for name, sides in body.fusion.extrapolation.items() if name not in free}
    sides = kept | dict.fromkeys(free, ("continue", "continue"))
    bare = replace(model, body=body.joined(hold="none", extrapolation=sides), shape=None)
    functions = program_of(bare).functions
    segments = [one.name for one in functions if one.note.startswith("the segment ")]
    curves = [one.name for one in functions if one.note.startswith("the curve ")]
    slopes = ", ".join(f"{name}_slopes" for name in segments)
    more = (
        f", segments: [{', '.join(segments)}], slopes: [{slopes}], "
        f"rejoin: (f) => {{ [{', '.join(curves)}] = f; }}"
    )
    return bare, more


def pieces_of(body: Pieces, equations: Mapping[str, str]) -> dict[str, Any]:
    """Return data for the page: the rules by which the pieces are joined, and for each piece, by
    its id, its equation and the range to which it was fitted.
    """
    fusion = body.fusion
    return {
        "level": body.level,
        "variables": list(body.variables),
        "joint": {
            "z_s": fusion.z_s,
            "transition": fusion.transition,
            "levels": fusion.levels,
            "hold": fusion.hold,
            "extrapolation": {name: list(sides) for name, sides in fusion.extrapolation.items()},
        },
        "curves": [
            {
                "level": curve.level,
                "limits": {name: list(ends) for name, ends in curve.limits.items()},
                "boundaries": [ends.tolist() for ends in curve.boundaries],
                "segments": [
                    {
                        "id": one.id,
                        "cell": list(one.cell),
                        "limits": {name: list(ends) for name, ends in one.limits.items()},
                        "equation": equations.get(one.id, ""),
                    }
                    for one in curve.segments
                ],
            }
            for curve in body.curves
        ],
    }
