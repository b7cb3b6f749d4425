"""Write a model as one module of JavaScript without dependencies, for browsers and Node, which
computes one sample for each call.
"""

from __future__ import annotations

import shutil
from typing import Any

from mapmore_cli.annexes.exporting.dialect import JAVASCRIPT
from mapmore_cli.annexes.exporting.program_text import program_words
from mapmore_cli.annexes.exporting.templates import (
    Code,
    Wanted,
    identifier,
    names_of_inputs,
    notes_of,
    rendered_template,
)
from mapmore_cli.annexes.exporting.verifying import CompilerMissing, verify_files
from mapmore_cli.annexes.exporting.words import words_of
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import fed_back
from mapmore_cli.modelling.program.slopes import with_slopes
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.modelling.ranges import OUTSIDE_TOLERANCE

NAMES = ("INPUTS", "OUTPUT", "STEP", "beyond", "interpolated", "measured", "outsideRange")
"""Names in the module that its inputs must not hide."""


def javascript_file(model: Model, wanted: Wanted) -> dict[str, str]:
    """Return the module. If Node is installed, compare its results with `predict`."""
    text = javascript_module(model)
    if wanted.verify:
        try:
            _verify(model, text)
        except CompilerMissing as reason:
            wanted.warn(f"{reason}: the module was not compared with `mapmore predict`")
    return {f"{identifier(model.name)}.mjs": text}


def javascript_module(model: Model) -> Code:
    """Return the text of the module.

    Every module exports `INPUTS`, `OUTPUT` and `outsideRange`. The module of a model without memory
    also exports `evaluate` and `derivatives`. With memory, it exports `STEP`, `reset`, `step` and,
    if the output is fed back, `measured`. The functions take numbers in the order of `INPUTS`.

    Raises DataError if a part of the model has no closed expression.
    """
    program = program_of(model)
    used = [*words_of("JavaScript"), *NAMES, *(function.name for function in program.functions)]
    names = names_of_inputs(model.inputs, used)
    words, slopes = program_words(program, JAVASCRIPT), dict[str, Any]()
    if program.step is None:
        slopes = program_words(with_slopes(program), JAVASCRIPT)
        words["helpers"] |= slopes["helpers"]
    return rendered_template(
        "module.mjs",
        **words,
        model=model,
        names=names,
        notes=notes_of(model, names),
        tolerance=OUTSIDE_TOLERANCE,
        slopes=slopes,
    )


def _verify(model: Model, text: str) -> None:
    """Compare the module with `predict` in Node. Raises CompilerMissing if Node is not
    installed.
    """
    node = shutil.which("node")
    if node is None:
        raise CompilerMissing("Node is not installed")
    driver = rendered_template(
        "verify.mjs",
        memory=program_of(model).step is not None,
        fed_back=bool(fed_back(model)),
        count=len(model.inputs),
    )
    verify_files(model, {"exported.mjs": text, "verify.mjs": driver}, [node, "verify.mjs"])
