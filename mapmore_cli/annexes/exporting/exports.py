"""Export models to other languages, as files by name.

An exporter is a function that takes a model and a request, and returns files. `EXPORTERS` holds
every format by its name in `mapmore export --to`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import PurePath
from typing import NamedTuple

from mapmore_cli.annexes.exporting.c_source import c_files, mujoco_files, simulink_files
from mapmore_cli.annexes.exporting.fmu import input_names, unit_file
from mapmore_cli.annexes.exporting.javascript import javascript_file
from mapmore_cli.annexes.exporting.matlab import matlab_file
from mapmore_cli.annexes.exporting.python_module import module_file
from mapmore_cli.annexes.exporting.table import lookup_table, table_files, tex_equations
from mapmore_cli.annexes.exporting.templates import (
    Wanted,
    identifier,
    name_of_output,
    names_of_inputs,
    rendered_template,
    with_notice,
)
from mapmore_cli.annexes.exporting.verifying import middle
from mapmore_cli.domain import plugins
from mapmore_cli.domain.errors import UsageError, Warn
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.programs import program_of

Exporter = Callable[[Model, Wanted], Mapping[str, str | bytes]]


class Form(NamedTuple):
    """A format in which `mapmore export` writes models.

    - `write`: function that returns the files by name.
    - `snippet`: template in `sources/snippets/` with lines that show how the files are called;
      empty if there is nothing to call.
    - `options`: options of the command that work with this format.
    - `whole`: True if all outputs of a model are written into the same files. Otherwise, each
      output gets its own files.
    - `notice`: True if files of code get the notice of mapmore's licence.
    - `endings`: endings of the names of those files that are written for every model, for example
      `_main.c`. The name of the model stands before the ending.
    """

    write: Exporter
    snippet: str = ""
    options: Collection[str] = ()
    whole: bool = False
    notice: bool = True
    endings: Sequence[str] = ()


_C = (".h", ".c", "_main.c")
EXPORTERS: dict[str, Form] = {
    "c": Form(c_files, "c.sh", ("--float", "--pressure"), whole=True, endings=_C),
    "fmu": Form(unit_file, "fmu.py", ("--pressure",), endings=(".fmu",)),
    "fmu3": Form(partial(unit_file, standard=3), "fmu.py", endings=("_fmi3.fmu",)),
    "csv": Form(lookup_table, options=("--grid",), endings=(".csv",)),
    "tex": Form(tex_equations, "tex.tex", whole=True, endings=(".tex",)),
    "py": Form(partial(module_file, plain=True), "py.py", endings=(".py",)),
    "numpy": Form(module_file, "numpy.py", endings=(".py",)),
    "table": Form(table_files, "table.m", ("--grid",), endings=(".csv", ".mat")),
    "matlab": Form(matlab_file, "matlab.m", endings=(".m",)),
    "js": Form(javascript_file, "js.mjs", endings=(".mjs",)),
    "mujoco": Form(mujoco_files, "mujoco.py", endings=(*_C, "_mujoco.c")),
    "simulink": Form(simulink_files, "simulink.m", endings=(*_C, "_simulink.h", "_simulink.c")),
}
"""Formats by the name after `--to`. To add a format, add a row here and a sentence to the help."""
_FUNCTION: type[Exporter] = Callable  # type: ignore[assignment]  # any function may be an exporter
EXPORTERS |= {
    part.name: Form(part.value, notice=False)
    for part in plugins.parts("exports", _FUNCTION, reserved=EXPORTERS)
}


def snippet(model: Model, to: str, files: Sequence[str]) -> str:
    """Return lines of code that show how the exported `files` are called, for a point in the middle
    of the training range; empty if there is nothing to call.
    """
    form = EXPORTERS[to]
    if not form.snippet:
        return ""
    model = _parts(model, form)[0]
    places, kept = middle(model), program_of(model).kept
    names = names_of_inputs(model.inputs)
    return rendered_template(
        f"snippets/{form.snippet}",
        name=identifier(model.name),
        files=files,
        output=name_of_output(model, names.values()),
        places={in_code: places[name] for name, in_code in names.items()},
        unit_inputs=input_names(model),
        step=kept.step,
        fed_back=bool(kept.fed_back),
    )


def names_of_files(model: Model, to: str) -> list[str]:
    """Return the names of the files that a format writes for every model. The names can be found
    without writing the code. For a format of a plug-in, the list is empty. Raises UsageError if
    there is no such format, or if the name of the model contains no letter.
    """
    form = _form(to)
    return [
        f"{identifier(output.name)}{ending}"
        for ending in form.endings
        for output in _parts(model, form)
    ]


def _form(to: str) -> Form:
    """Return one of the `EXPORTERS` by its name. Raises UsageError if there is no such format."""
    if to not in EXPORTERS:
        raise UsageError(f"there is no export to {to!r}", f"choose one of {', '.join(EXPORTERS)}")
    return EXPORTERS[to]


def _parts(model: Model, form: Form) -> Sequence[Model]:
    """Return the models that are written one after the other: the whole model if the format writes
    all outputs together, otherwise the model of each output.
    """
    return [model] if form.whole else model.each


def exported(
    model: Model,
    to: str,
    *,
    single: bool = False,
    grid: str | None = None,
    verify: bool = True,
    warn: Warn = lambda _text: None,
) -> dict[str, bytes]:
    """Return the files of a model in one of the formats of `EXPORTERS`. With `single`, C code is
    written in single precision.

    If the model has several outputs, the C code is one function for all of them; most other formats
    have files for each output, with its name. `grid` gives the points of `csv` and `table`. `csv`
    needs it; without it, `table` has points that are spread over the training range.

    With `verify`, the code of `c`, of FMUs, modules and functions is compared with `predict`.
    `warn` is called if an FMU has no binary for this machine, and if nothing could be compared
    because there is no compiler.

    Raises UsageError for a grid that is malformed or goes beyond the training range, and for a name
    without a letter; DataError if a part of the model has no closed expression; MapmoreError if the
    code gives other numbers than `predict`.
    """
    form, files = _form(to), dict[str, str | bytes]()
    for output in _parts(model, form):
        of_output = form.write(output, Wanted(single, grid, verify, warn))
        _refuse_odd(to, of_output)
        files |= of_output
    if form.notice:
        files = {
            name: with_notice(name, data) if isinstance(data, str) else data
            for name, data in files.items()
        }
    return {name: data.encode() if isinstance(data, str) else data for name, data in files.items()}


def _refuse_odd(to: str, files: object) -> None:
    """Raise UsageError if a plug-in returns no files, or a file with a folder in its name."""
    fault = ""
    if not isinstance(files, Mapping):
        fault = f"returns {type(files).__name__} instead of files by name"
    elif odd := [name for name in files if PurePath(name).name != name]:
        fault = f"names the file {odd[0]!r}, which is not a plain name"
    if fault:
        raise UsageError(
            f"the plug-in of the export {to!r} {fault}", "ask its authors, or uninstall it"
        )
