"""C99 source of a model: no allocation, no global state, only `math.h`."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.c_inverse import InverseSource
from mapmore_cli.exporting.c_source import Source
from mapmore_cli.exporting.names import identifier
from mapmore_cli.modelling.assignments.slopes import with_slopes
from mapmore_cli.modelling.kinds import assignments

MOST_INPUTS = 14
"""Bits of the returned number, one for every input and one more: an `int` may have 16."""


@dataclass(frozen=True)
class CSource:
    """The files of a model in C, by name, and what its functions begin with."""

    name: str
    files: dict[str, str]


def c_source(model: Model, single: bool = False) -> CSource:
    """Header, source and a small program to try the model with; in single precision if so wished.

    For a model without memory a second header and source have its derivatives and its inverse.

    Raises
    ------
    UsageError
        Where the model's name has nothing that C allows, or it has too many inputs.
    DataError
        Where a part of the model is no closed expression.
    """
    name = identifier(model.name)
    if len(model.inputs) > MOST_INPUTS:
        raise UsageError(f"{model.name} has {len(model.inputs)} inputs; one bit each leaves room for {MOST_INPUTS}", "export its parts")
    code = assignments(model)
    source = Source(model, code, name, single)
    files = {f"{name}.h": source.header(), f"{name}.c": source.source(), f"{name}_main.c": source.program()}
    inverse = {} if source.with_memory else InverseSource(Source(model, with_slopes(code), name, single)).files()
    return CSource(name, {**files, **inverse})
