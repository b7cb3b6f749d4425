"""Find the structure of a model: `search.json`, and the spec `found.yaml` that it makes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pydantic_core import to_json

from mapmore_cli.annexes.search.bench import Slice
from mapmore_cli.annexes.search.searching import formula_beside, search, settings_of
from mapmore_cli.fitting.stage import Stage, Workspace
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.storage.atomic import write_text
from mapmore_cli.storage.run_folder import SEARCH, RunFiles
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.data import Direction, Rate

if TYPE_CHECKING:
    from mapmore_cli.study.loader import LoadedSpec


def search_slice(spec: ExperimentSpec) -> Slice:
    """Return the slice of the spec. Rates by which samples are kept, groups, and what the target is
    made of, or makes, are no inputs.
    """
    rules = spec.data.derive
    rates = {name for name, rule in rules.items() if not isinstance(rule, str)}
    ignored = (
        *_kin(spec.target_quantity, spec),
        *(rule.quantity for rule in spec.data.keep if rule.quantity in rates),
    )
    ignored += () if spec.data.groups is None else (spec.data.groups.of,)
    split = spec.data.split
    return Slice(
        spec.data.levels,
        spec.model,
        spec.fuse,
        spec.muscle.lengths,
        split.hold_out,
        ignored,
        split.leave_one_level_out,
    )


def _kin(target: str, spec: ExperimentSpec) -> tuple[str, ...]:
    """Return the target (of which another may be a component), the one quantity that it is derived
    from, and what is derived from it.
    """
    sources = {name: _sources(rule) for name, rule in spec.data.derive.items()}
    made = {target}
    while more := {name for name, of in sources.items() if of & made} - made:
        made |= more
    of = sources.get(target, set())
    return (target, *sorted(made - {target}), *(sorted(of) if len(of) == 1 else ()))


def _sources(rule: str | Rate | Direction) -> set[str]:
    """Return the quantities that one is derived from."""
    match rule:
        case Rate():
            return {rule.rate_of}
        case Direction():
            return {rule.direction_of}
        case _:
            return set(parse(rule).names)


def run_search(part: Slice, workspace: Workspace) -> None:
    """Search, and write what was tried."""
    dataset = workspace.files.dataset()
    result = search(dataset, part, workspace.progress)
    for note in result.notes:
        workspace.warn(note)
    write_text(
        workspace.out / SEARCH, to_json(result, indent=1, inf_nan_mode="strings").decode() + "\n"
    )


STAGE = Stage(name="search", revision=12, outputs=(SEARCH,), reads=search_slice, run=run_search)


def with_found(loaded: LoadedSpec, run_dir: Path) -> LoadedSpec:
    """Return the spec with the structure that its search has found; as it is where nothing was
    found yet.

    Where it names no competitors, the formula that erred least in the search is one: the page says
    what it reaches on the held-out data.
    """
    from mapmore_cli.study.loader import load
    from mapmore_cli.study.yaml_loader import as_overrides

    result = RunFiles(run_dir).search()
    if result is None:
        return loaded
    rival = formula_beside(result)
    beside = {"validate.against": [rival]} if rival and not loaded.spec.validation.against else {}
    return load(loaded.path, (*loaded.overrides, *as_overrides({**settings_of(result), **beside})))
