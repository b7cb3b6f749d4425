"""Runs whose models a stage reads: other specs, kept up to date in the same folder of runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.stages.stage import Stage

if TYPE_CHECKING:
    from mapmore_cli.spec.loader import LoadedSpec

MODEL_STAGE = "fuse"
"""The stage after which a run has the model that others read."""


@dataclass(frozen=True)
class Needed:
    """Another run: its path in the spec, its own spec, and the specs that led to it, outermost first."""

    path: str
    loaded: LoadedSpec
    heirs: tuple[Path, ...]


def needed_runs(stage: Stage, loaded: LoadedSpec, heirs: tuple[Path, ...]) -> list[Needed]:
    """The runs that a stage needs, in the order of the spec.

    Raises
    ------
    SpecError
        Where runs need each other in a circle, or a needed spec is missing or wrong.
    """
    from mapmore_cli.spec.loader import load

    found = []
    for path in stage.needs(loaded.spec):
        chain = (*heirs, loaded.path.resolve())
        other = loaded.folder / path
        if other.resolve() in chain:
            circle = " -> ".join(spec.name for spec in (*chain, other))
            raise SpecError(f"{loaded.path}: runs need each other in a circle: {circle}", "remove one of them")
        found.append(Needed(path, load(other), chain))
    return found
