"""Find the structure of a model, and write the results: `search.json` and the spec `found.yaml`."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter
from pydantic_core import to_json

from mapmore_cli.annexes.search.bench import Slice
from mapmore_cli.annexes.search.searching import search
from mapmore_cli.annexes.search.trying import EMPTY, choices_of
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Search
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.fitting.stage import Stage, Workspace
from mapmore_cli.storage.atomic import write_own
from mapmore_cli.storage.run_folder import SEARCH, RunFiles
from mapmore_cli.storage.run_record import load_records
from mapmore_cli.study.experiment import ExperimentSpec

if TYPE_CHECKING:
    from mapmore_cli.study.loader import LoadedSpec


def search_slice(spec: ExperimentSpec) -> Slice:
    """Return the part of the spec on which the search depends. Three kinds of quantities are never
    inputs: rates by which samples are kept, quantities that distinguish groups or recordings, and
    quantities from which the target is computed or that are computed from it.
    """
    rules = spec.data.derive
    rates = {name for name, rule in rules.items() if not isinstance(rule, str)}
    ignored = (
        *_kin(spec.target_quantity, spec),
        *(rule.quantity for rule in spec.data.keep if rule.quantity in rates),
    )
    ignored += () if spec.data.groups is None else (spec.data.groups.of,)
    ignored += () if spec.data.recordings is None else (*spec.data.recordings.quantities,)
    split = spec.data.split
    return Slice(
        spec.data.levels,
        spec.model,
        spec.fuse,
        spec.muscle.lengths,
        split.hold_out,
        ignored,
        split.leaves_out,
    )


def _kin(target: str, spec: ExperimentSpec) -> tuple[str, ...]:
    """Return the quantities that contain the target: the target itself, all quantities that are
    derived from the target, and, if the target is derived from a single quantity, this
    quantity.
    """
    of = spec.data.sources.get(target, ())
    made = spec.data.computed_from(target)
    return (target, *sorted(made), *(sorted(of) if len(of) == 1 else ()))


def run_search(part: Slice, workspace: Workspace) -> None:
    """Search the structure, and write the structures that were tried."""
    dataset = workspace.files.dataset()
    result = search(dataset, part, workspace.progress)
    for note in result.notes:
        workspace.warn(note)
    write_own(
        workspace.out / SEARCH, to_json(result, indent=1, inf_nan_mode="strings").decode() + "\n"
    )


STAGE = Stage(name="search", revision=23, outputs=(SEARCH,), reads=search_slice, run=run_search)


def settings_of(result: Search) -> dict[str, Any]:
    """Return the sections that were found, as settings on top of the spec."""
    return {**EMPTY, **result.found.sections}


def formulas_beside(result: Search, every: bool = False) -> list[str]:
    """Return the formula of the literature that has the smallest error of all that were tried;
    none if this formula is the chosen structure. With `every`, return all formulas, so
    that they are not selected by their errors.
    """
    formulas = [tried for tried in result.tried if tried.family == "formula" and not tried.failure]
    if not every:
        best = min(formulas, key=attrgetter("excess"), default=result.found)
        formulas = [best] * (best is not result.found)
    return [str(tried.sections["model"]["name"]) for tried in formulas]


def with_found(loaded: LoadedSpec, run_dir: Path) -> LoadedSpec:
    """Return the spec with the structure that its search has found; unchanged if nothing was found
    yet.

    If the spec names no competitors, the formula with the smallest error in the search becomes a
    competitor, so that the page shows its error on the held-out data. If every level or group is
    left out once, the search has seen all of them. Then all formulas are competitors. The spec also
    records that the structure was chosen with all data, in case the spec is run without the search.
    """
    from mapmore_cli.study.loader import changed
    from mapmore_cli.study.yaml_dumper import as_overrides

    result = RunFiles(run_dir).search()
    if result is None:
        return loaded
    seen = loaded.spec.data.split.leaves_out
    rivals = [] if loaded.spec.validation.against else formulas_beside(result, seen)
    settings = {
        **settings_of(result),
        **({"validate.against": rivals} if rivals else {}),
        **({"data.split.structure_seen": True} if seen else {}),
    }
    return changed(loaded, as_overrides(settings))


_SLICE = TypeAdapter(Slice)


def searching_again(run_dir: Path) -> Callable[[Dataset], ModelChoices]:
    """Return a function that finds a structure from the training samples of a dataset, like
    the search of a run. The function tries longer structures only if the search of the run did.
    """
    recorded = load_records(run_dir)[STAGE.name].slice
    part = _SLICE.validate_json(to_json(recorded))
    whole = RunFiles(run_dir).search()
    beside = whole is not None and whole.short is not None
    return lambda dataset: choices_of(search(dataset, part, beside=beside).found.sections, part)
