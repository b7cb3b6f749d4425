"""Find the structure of a model, and write the results: `search.json` and the spec `found.yaml`."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter
from pydantic_core import to_json

from mapmore_cli.annexes.search.bench import Slice
from mapmore_cli.annexes.search.black_boxes import BLACK_BOX
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
    """Return the part of the spec on which the search depends. Its `ignored` quantities are never
    inputs of a model:

    - the target, and quantities that are computed from it;
    - the quantity from which the target is computed, if there is a single one;
    - rates by which the samples to keep are selected;
    - quantities that distinguish groups or recordings.
    """
    data, target = spec.data, spec.target_quantity
    of = data.sources.get(target, ())
    ignored = [target, *sorted(data.computed_from(target)), *(of if len(of) == 1 else ())]
    rates = {name for name, rule in data.derive.items() if not isinstance(rule, str)}
    ignored += [rule.quantity for rule in data.keep if rule.quantity in rates]
    ignored += [] if data.groups is None else [data.groups.of]
    ignored += [] if data.recordings is None else data.recordings.quantities
    return Slice(
        data.levels,
        spec.model,
        spec.fuse,
        spec.muscle.lengths,
        data.split.hold_out,
        tuple(ignored),
        data.split.leaves_out,
    )


def run_search(part: Slice, workspace: Workspace) -> None:
    """Search the structure, and write the structures that were tried."""
    dataset = workspace.files.dataset()
    result = search(dataset, part, workspace.progress)
    for note in result.notes:
        workspace.warn(note)
    write_own(
        workspace.out / SEARCH, to_json(result, indent=1, inf_nan_mode="strings").decode() + "\n"
    )


STAGE = Stage(name="search", revision=25, outputs=(SEARCH,), reads=search_slice, run=run_search)


def rivals_beside(result: Search, every: bool = False, boxes: bool = True) -> list[str]:
    """Return the names of the competitors of a run whose spec has no list of competitors: the
    formula of the literature that has the smallest error in the search, unless this formula is the
    chosen structure, and the black boxes that the search fitted. If scikit-learn is not installed,
    there are no black boxes, because competitors are fitted with it.

    - `every`: return all formulas, because the search has seen all data, so that the best formula
      would be selected by its error on the held-out data.
    - `boxes`: whether black boxes are returned.
    """
    formulas = [tried for tried in result.tried if tried.family == "formula" and not tried.failure]
    if not every:
        best = sorted(formulas, key=attrgetter("excess"))[:1]
        formulas = [tried for tried in best if tried is not result.found]
    names = [str(tried.sections["model"]["name"]) for tried in formulas]
    if boxes and find_spec("sklearn") is not None:
        fitted = (tried.words for tried in result.tried if tried.family == BLACK_BOX)
        names += [words.replace(" ", "_") for words in fitted]
    return names


def with_found(loaded: LoadedSpec, run_dir: Path) -> LoadedSpec:
    """Return the spec with the structure that its search has found; unchanged if nothing was found
    yet.

    If the spec has no list of competitors, not even an empty one, the formula with the smallest
    error in the search and the black boxes become competitors, so that the page shows their errors
    on the held-out data. If every level or group is left out once, the search has seen all of them.
    Then all formulas are competitors. The spec also records that the structure was chosen with all
    data, in case the spec is run without the search.

    Black boxes become competitors only if `split.validate` holds data out. On training data, the
    error of a black box says nothing. If every level or group is left out once, fitting the black
    boxes again each time would make the run slower by more than a quarter.
    """
    from mapmore_cli.study.loader import changed
    from mapmore_cli.study.yaml_dumper import as_overrides

    result = RunFiles(run_dir).search()
    if result is None:
        return loaded
    settings, split = {**EMPTY, **result.found.sections}, loaded.spec.data.split
    rivals = rivals_beside(result, split.leaves_out, split.hold_out is not None)
    if rivals and "against" not in loaded.spec.validation.model_fields_set:
        settings["validate.against"] = rivals
    if split.leaves_out:
        settings["data.split.structure_seen"] = True
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
