"""Export models to other languages, as files by name.

An exporter takes a model and a request, and returns its files. `EXPORTERS` holds every exporter by
the word after `mapmore export --to`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import PurePath

from mapmore_cli.annexes.exporting.c_source import c_files, mujoco_files, simulink_files
from mapmore_cli.annexes.exporting.fmu import input_names, unit_file
from mapmore_cli.annexes.exporting.javascript import javascript_file
from mapmore_cli.annexes.exporting.matlab import matlab_file
from mapmore_cli.annexes.exporting.python_module import module_file
from mapmore_cli.annexes.exporting.table import lookup_table, table_files, tex_equations
from mapmore_cli.annexes.exporting.templates import (
    Wanted,
    Warn,
    identifier,
    name_of_output,
    names_of_inputs,
    rendered_template,
    with_notice,
)
from mapmore_cli.annexes.exporting.verifying import middle
from mapmore_cli.domain import plugins
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.programs import program_of

Exporter = Callable[[Model, Wanted], Mapping[str, str | bytes]]

EXPORTERS: dict[str, Exporter] = {
    "c": c_files,
    "fmu": unit_file,
    "fmu3": partial(unit_file, standard=3),
    "csv": lookup_table,
    "tex": tex_equations,
    "py": partial(module_file, plain=True),
    "numpy": module_file,
    "table": table_files,
    "matlab": matlab_file,
    "js": javascript_file,
    "mujoco": mujoco_files,
    "simulink": simulink_files,
}
_FUNCTION: type[Exporter] = Callable  # type: ignore[assignment]  # any may be an exporter
_ADDED = {part.name: part.value for part in plugins.parts("exports", _FUNCTION, reserved=EXPORTERS)}
EXPORTERS |= _ADDED


SEVERAL = ("c", "tex")
"""Forms that contain all outputs of a model; others are written once for each output."""

SNIPPETS = {
    **{"c": "c.sh", "fmu": "fmu.py", "fmu3": "fmu.py", "py": "py.py", "numpy": "numpy.py"},
    **{"matlab": "matlab.m", "mujoco": "mujoco.py", "simulink": "simulink.m", "table": "table.m"},
    **{"js": "js.mjs", "tex": "tex.tex"},
}
"""Templates in `sources/snippets/` that call an export, by its word."""


def snippet(model: Model, to: str, files: Sequence[str]) -> str:
    """Return lines that call the exported `files` in the middle of the training range; empty if
    there is nothing to call.
    """
    if to not in SNIPPETS:
        return ""
    model = model if to in SEVERAL else model.each[0]
    places, kept = middle(model), program_of(model).kept
    names = names_of_inputs(model.inputs)
    return rendered_template(
        f"snippets/{SNIPPETS[to]}",
        name=identifier(model.name),
        files=files,
        output=name_of_output(model, names.values()),
        places={in_code: places[name] for name, in_code in names.items()},
        unit_inputs=input_names(model),
        step=kept.step,
        fed_back=bool(kept.fed_back),
    )


def exported(
    model: Model,
    to: str,
    *,
    single: bool = False,
    grid: str | None = None,
    verify: bool = True,
    warn: Warn = lambda _text: None,
) -> dict[str, bytes]:
    """Return the files of a model by one of the `EXPORTERS`; C may be of `single` precision.

    With several outputs, C is one function; other forms are written for each output, with its name.
    `csv` has the points of a `grid`, `table` those of a `grid` or of the training range.

    With `verify`, C, units and modules are compared with `predict`. `warn` is called if a unit has
    no binary for this machine, and if nothing could be compared because there is no compiler.

    Raises UsageError for a grid that is malformed or goes beyond the training range, and for a name
    without a letter; DataError if a part of the model has no closed expression; MapmoreError if the
    code gives other numbers than `predict`.
    """
    if to not in EXPORTERS:
        raise UsageError(f"there is no export to {to!r}", f"choose one of {', '.join(EXPORTERS)}")
    wanted, files = Wanted(single, grid, verify, warn), dict[str, str | bytes]()
    for output in [model] if to in SEVERAL else model.each:
        of_output = EXPORTERS[to](output, wanted)
        _refuse_odd(to, of_output)
        files |= of_output
    if to not in _ADDED:
        files = {
            name: with_notice(name, data) if isinstance(data, str) else data
            for name, data in files.items()
        }
    return {name: data.encode() if isinstance(data, str) else data for name, data in files.items()}


def _refuse_odd(to: str, files: object) -> None:
    """Raise UsageError if a plug-in does not return files, or files for other folders."""
    fault = ""
    if not isinstance(files, Mapping):
        fault = f"returns {type(files).__name__} instead of files by name"
    elif odd := [name for name in files if PurePath(name).name != name]:
        fault = f"names the file {odd[0]!r}, which is not a plain name"
    if fault:
        raise UsageError(f"the plug-in of the export {to!r} {fault}", "ask its authors")
