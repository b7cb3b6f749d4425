"""Runs whose models a stage reads: other specs, or the spec itself with other settings, kept up to date in the same folder of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.fitting.stage import Compared, Need, Stage, Variation

if TYPE_CHECKING:
    from mapmore_cli.spec.loader import LoadedSpec

MODEL_STAGE = "fuse"
"""The stage after which a run has the model that others read."""


@dataclass(frozen=True)
class Needed:
    """Another run: its path in the spec or its name there, its own spec, and the specs that led to it, outermost first.

    A run that is only `compared` with is never made anew by this one; one that is `built_on` is brought up to date as a whole, with its
    page; a `variation` has no page.
    """

    key: str
    loaded: LoadedSpec
    heirs: tuple[Path, ...]
    role: Literal["built_on", "compared", "variation"] = "built_on"


def needed_runs(stage: Stage, loaded: LoadedSpec, heirs: tuple[Path, ...]) -> list[Needed]:
    """Return the runs that a stage needs, in the order of the spec; raises as `runs_at`."""
    return runs_at(stage.needs(loaded.spec), loaded, heirs)


def runs_built_on(loaded: LoadedSpec, heirs: tuple[Path, ...]) -> list[Needed]:
    """Return the runs of `needs:`, whose reports belong to this run's; raises as `runs_at`."""
    needs = loaded.spec.needs
    return runs_at([path for path in (needs.static, needs.damping) if path is not None], loaded, heirs)


def runs_at(needs: Sequence[Need], loaded: LoadedSpec, heirs: tuple[Path, ...]) -> list[Needed]:
    """Return the runs of the specs at some paths from a spec's folder, and of variations of the spec itself.

    Raises SpecError where runs need each other in a circle, or a needed spec is missing or wrong.
    """
    from mapmore_cli.spec.loader import load

    found = []
    chain = (*heirs, loaded.path.resolve())
    for need in needs:
        if isinstance(need, Variation):
            found.append(Needed(need.name, _varied(loaded, need), chain, "variation"))
            continue
        path = need.path if isinstance(need, Compared) else need
        other = loaded.folder / path
        if other.resolve() in chain:
            circle = " -> ".join(spec.name for spec in (*chain, other))
            raise SpecError(f"{loaded.path}: runs need each other in a circle: {circle}", "remove one of them")
        found.append(Needed(path, load(other), chain, "compared" if isinstance(need, Compared) else "built_on"))
    return found


def _varied(loaded: LoadedSpec, variation: Variation) -> LoadedSpec:
    """Return the spec with other settings, and without competitors: it is one, and those of the spec may not suit it."""
    from mapmore_cli.spec.layers import as_overrides
    from mapmore_cli.spec.loader import load

    own = as_overrides({"name": f"{loaded.spec.name}.{variation.name}", "validate.against": [], "validate.intervals": False})
    try:
        return load(loaded.path, (*loaded.overrides, *variation.overrides, *own))
    except SpecError as error:
        raise SpecError(f"{loaded.path}: as `{variation.name}`, with other settings: {error.message}", error.remedy) from error
