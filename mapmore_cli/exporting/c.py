"""C99 source of a model: no allocation, no global state, only `math.h`."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.c_inverse import InverseSource
from mapmore_cli.exporting.c_source import source_of
from mapmore_cli.modelling.program.slopes import with_slopes


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
    source = source_of(model, single)
    name = source.name
    files = {f"{name}.h": source.header(), f"{name}.c": source.source(), f"{name}_main.c": source.program()}
    inverse = {} if source.with_memory else InverseSource(replace(source, code=with_slopes(source.code))).files()
    return CSource(name, {**files, **inverse})
