"""Prepare the data with which a page computes models in the browser: the code of the models in
JavaScript, and samples.

The optional part of mapmore that exports models writes the code. If this part is not installed, a
page has no section "Explore".
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from typing import Any, get_args

from mapmore_cli.domain import plugins
from mapmore_cli.domain.declared import Beyond
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.joining import TRANSITIONS
from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.reporting.competitors import is_known
from mapmore_cli.reporting.explore_data import study_of
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.scripts import json_text
from mapmore_cli.reporting.table import title_of

LINES = [(f"--other{number}", dash) for dash in ([7, 3], [2, 3]) for number in (1, 2, 3, 4, 5)]
"""Colour and dashes of the line of each competitor. The colours are names of variables in
`explore.css`.
"""

MOST_SEGMENTS = 100
"""Largest number of segments of a model that a page computes. The code of so many segments has half
a megabyte.
"""

Sides = tuple[Any, Any]
"""Two behaviours of a model: below and above the limits of an input."""

_EXPORTED = re.compile(r"\nexport \{ (.*) \};\n$")
_COMMENTS = re.compile(r"^/\*\*$.*?^ \*/\n", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Explored:
    """Contents of the section "Explore" of a page.

    - `outputs`: data of each output for its script, ready for JSON; None if the model of the output
      has no closed expression, or has too many segments.
    - `code`: a script that stores every model in `mapmore.models`, by the keys that are named in
      `outputs`.
    """

    outputs: tuple[dict[str, Any] | None, ...]
    code: str


def explored(every: Sequence[ReportInputs]) -> Explored | None:
    """Return the section "Explore" for the outputs of a run. Return None if each model has too many
    segments or cannot be written as JavaScript, or if the part of mapmore that exports models is
    not installed.
    """
    try:
        plugins.load("python", "export")
    except plugins.NotInstalled:
        return None
    code: dict[str, str] = {}

    def module(key: str, model: Model, more: str = "") -> bool:
        """Store the code of a model. Return False if the model cannot be written as code."""
        try:
            code[key] = wrapped(key, model, more)
        except MapmoreError:  # a part of the model has no closed expression
            return False
        return True

    outputs: list[dict[str, Any] | None] = []
    for number, inputs in enumerate(every):
        key = f"model{number}"
        if uncomputed_segments(inputs.model) or not module(key, inputs.model):
            outputs.append(None)
            continue
        others = [
            {"key": f"{key}.{place}", "title": title_of(name), "color": color, "dash": dash}
            for place, ((name, other), (color, dash)) in enumerate(
                zip(_competitors(inputs).items(), cycle(LINES))
            )
            if module(f"{key}.{place}", other)
        ]
        known = study_of(inputs, key) | {"others": others}
        pieces = inputs.model.pieces
        if pieces is not None and pieces.segments:
            bare, more = bare_of(inputs.model)
            if module(f"{key}.pieces", bare, more):
                texts = {equation.id: equation.text for equation in inputs.equations}
                known["pieces"] = pieces_of(inputs.model, texts) | {"key": f"{key}.pieces"}
        outputs.append(known)
    if not code:
        return None
    start = '"use strict";\nwindow.mapmore = { models: {} };\n'
    return Explored(tuple(outputs), start + "".join(code.values()))


def uncomputed_segments(model: Model) -> int:
    """Return the number of segments if it is larger than `MOST_SEGMENTS`, so that the page does not
    compute the model; otherwise return zero.
    """
    count = len(model.pieces.segments) if model.pieces else 0
    return count if count > MOST_SEGMENTS else 0


def wrapped(key: str, model: Model, more: str = "") -> str:
    """Return JavaScript that stores a model as `mapmore.models[key]`. Because a page cannot import
    modules, the exported module of the model is changed to a function that is called at once, and
    its result is stored. `more` is code for further members of this result.

    Raises DataError if a part of the model has no closed expression.
    """
    (text,) = plugins.load("python", "export")(model, "js", verify=False).values()
    code = _COMMENTS.sub("", text.decode())  # nobody reads comments in a page
    inside = _EXPORTED.sub(rf"\nreturn {{ \1{more} }};\n", code)
    return f"mapmore.models[{json_text(key)}] = (() => {{\n{inside}}})();\n"


def _competitors(inputs: ReportInputs) -> dict[str, Model]:
    """Return the competitors that the page can compute together with the model. They predict the
    same quantity as the model, and need no other inputs. A competitor with memory must also have
    the same time step as the model.
    """
    model = inputs.model
    known, steps = {quantity.name for quantity in model.inputs}, _steps_of(model)
    return {
        name: competitor
        for name, competitor in inputs.validation.models.items()
        if name in inputs.models
        and competitor.output == model.output
        and is_known(competitor)
        and not uncomputed_segments(competitor)
        and {quantity.name for quantity in competitor.inputs} <= known
        and _steps_of(competitor) <= steps
    }


def _steps_of(model: Model) -> set[float]:
    """Return the time steps of a model and of its parts, in s. The set is empty if no part has
    memory.
    """
    return {memory.states.step for memory in model.memories}


def bare_of(model: Model) -> tuple[Model, str]:
    """Return a model and JavaScript code with which a page can join the pieces of a model in other
    ways. In the returned model, each segment function also applies outside the range of its
    samples, without any change. The code adds members to the JavaScript object of the model: the
    curves, the segments with their slopes, and all transitions.

    A further member is the function `rejoin`, which replaces the functions of the curves.
    """
    body = model.body_of(Pieces)
    free = [quantity.name for quantity in model.inputs if quantity.name != body.level]
    kept = {name: sides for name, sides in body.fusion.extrapolation.items() if name not in free}
    sides = kept | dict.fromkeys(free, ("continue", "continue"))
    bare = replace(model, body=body.joined(hold="none", extrapolation=sides), shape=None)
    functions = program_of(bare).functions
    segments = iter(
        function.name for function in functions if function.note.startswith("the segment ")
    )
    curves = [function.name for function in functions if function.note.startswith("the curve ")]
    by_curve = [[next(segments) for _ in curve.segments] for curve in body.curves]
    names = "], [".join(map(", ".join, by_curve))
    slopes = "], [".join(
        ", ".join(f"{segment}_slopes" for segment in segments_of_curve)
        for segments_of_curve in by_curve
    )
    courses = ", ".join(
        f"{name}: {_course(transition.words)}" for name, transition in TRANSITIONS.items()
    )
    more = (
        f", segments: [[{names}]], slopes: [[{slopes}]], transitions: {{ {courses} }}, "
        f"rejoin: (f) => {{ [{', '.join(curves)}] = f; }}"
    )
    return bare, more


def _course(words: str) -> str:
    """Return a function in JavaScript for a transition between pieces. The transition is given as a
    formula such as `w = 3*t^2 - 2*t^3`.
    """
    first, _, rest = words.removeprefix("w = ").partition(" up to t = 1/2, then ")
    text = f"t < 0.5 ? {first} : {rest}" if rest else first
    return "(t) => " + re.sub(r"([a-z]\w+)\(", r"Math.\1(", text).replace("^", " ** ")


def pieces_of(model: Model, equations: Mapping[str, str]) -> dict[str, Any]:
    """Return data for the page: the rules by which the pieces are joined, the curves, and for each
    piece its id, its equation and the range to which it was fitted.
    """
    body = model.body_of(Pieces)
    fusion = body.fusion
    free = [quantity.name for quantity in model.inputs if quantity.name != body.level]
    sides = dict.fromkeys(free, ("continue", "continue")) | dict(fusion.extrapolation)
    cut = " or ".join(body.variables).replace("_", " ")
    return {
        "sides": {name: _sides(sides[name]) for name in free},
        "choose": f"Choose {cut} above to see the pieces along it.",
        "level": body.level,
        "transitions": [(name, name) for name in TRANSITIONS],
        "variables": body.variables,
        "joint": {
            "z_s": fusion.z_s,
            "transition": fusion.transition,
            "levels": fusion.levels,
            "hold": fusion.hold,
            "extrapolation": sides,
        },
        "curves": [
            {
                "level": curve.level,
                "limits": dict(curve.limits),
                "boundaries": [ends.tolist() for ends in curve.boundaries],
                "segments": [
                    {
                        "id": segment.id,
                        "cell": segment.cell,
                        "limits": dict(segment.limits),
                        "equation": equations.get(segment.id, ""),
                    }
                    for segment in curve.segments
                ],
            }
            for curve in body.curves
        ],
    }


def _sides(fitted: Sides) -> list[tuple[str, str]]:
    """Return the possible behaviours of a model outside the limits of an input, for example
    `saturate` on both sides. Each is a pair of texts: the behaviour as JSON, and its title. The
    behaviour of this model, `fitted`, comes first.
    """
    titles = {"continue_linear": "continue straight"}
    known: dict[Sides, str] = {(way, way): titles.get(way, way) for way in get_args(Beyond)}
    chosen = {fitted: known.get(fitted, "as fitted")}
    return [(json.dumps(ends), title) for ends, title in (chosen | known).items()]
