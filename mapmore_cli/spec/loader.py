"""From a YAML file to a validated spec that knows where each of its values was written, and makes sense as a whole."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import takewhile
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import BaseModel, ValidationError

from mapmore_cli.spec import check_dictionary, check_models, check_names, check_study
from mapmore_cli.spec.diagnostics import MOST_ERRORS, Finding, Mistake, explain, faulty, locate, new_places, raise_if_any, unknown_keys
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.fields import PARTIAL, moved, resolve
from mapmore_cli.spec.layers import apply, read, read_text, with_formulas, with_units
from mapmore_cli.spec.tree import Kind, Loc, Node, nearest, plain, without
from mapmore_cli.spec.yaml_loader import dump, escaped

CHECKS = (
    check_names.names,
    check_names.derived,
    check_names.clocks,
    check_names.expressions,
    check_dictionary.terms,
    check_study.levels,
    check_study.groups,
    check_study.after_cycles,
    check_study.boundaries_by_fits,
    check_study.joining,
    check_study.chosen_backbone,
    check_study.turned,
    check_study.held_out,
    check_study.target,
    check_study.own_formulas,
    check_study.formulas,
    check_study.metrics,
    check_study.units,
    check_models.sums,
    check_models.needed_runs,
    check_models.plateaus,
    check_models.families,
    check_models.directions,
    check_models.training_level,
    check_models.load_cycle_formulas,
    check_models.composites,
    check_names.time_of_memory,
    check_names.segments,
    check_names.settings,
    check_models.time,
    check_models.quantities,
    check_models.sections,
)


def findings(spec: ExperimentSpec) -> Iterator[Finding]:
    """Every mistake of an experiment whose form is right."""
    for check in CHECKS:
        yield from check(spec)


M = TypeVar("M", bound=BaseModel)
Check = Callable[[M], Iterable[Finding]]
"""Looks for mistakes that no field shows by itself."""


@dataclass(frozen=True)
class Loaded(Generic[M]):
    """A valid spec.

    - `spec`: what the file says, with defaults; numbers in the model's units.
    - `path`, `folder`: the file, and the folder that relative paths start at.
    - `overrides`: what was set on top of the file.
    """

    spec: M
    path: Path
    folder: Path
    overrides: tuple[str, ...]
    _root: Node = field(repr=False, compare=False)

    @cached_property
    def resolved(self) -> str:
        """YAML with the defaults filled in and `extends`, variables and units resolved; it loads to an equal spec."""
        return resolved(self.spec)

    def resolved_in(self, folder: Path, given_only: bool = False) -> str:
        """Return the resolved spec for a file in another folder: relative paths start there, so that it runs again where it lies.

        With `given_only`, without the defaults.
        """
        if not given_only:
            return resolved(self.spec, self.folder, folder)
        return dump(escaped(moved(plain(self._root), [Kind(type(self.spec))], self.folder.resolve(), folder.resolve())))

    def where(self, *loc: str | int) -> str:
        """`file:line:column` of a key or list item, or of the nearest section around it that the files hold."""
        return str(nearest(self._root, loc).start)


LoadedSpec = Loaded[ExperimentSpec]
"""A valid experiment."""


def load(path: Path, overrides: Sequence[str] = ()) -> LoadedSpec:
    """Read an experiment spec, with `key.path=value` overrides on top.

    Raises SpecError for every mistake at once, each with its place, the source line, and what would be right; UsageError for an override
    that is not of the form `key.path=value`.
    """
    return load_as(path, ExperimentSpec, overrides, findings)


def load_as(path: Path, model: type[M], overrides: Sequence[str] = (), check: Check[M] = lambda _: ()) -> Loaded[M]:
    """Read a spec of any kind; raises as `load` does."""
    problems: list[Mistake] = []
    return _valid(apply(read(path, problems), overrides, problems), path, model, overrides, check, problems)


def load_text(text: str, name: str, folder: Path) -> LoadedSpec:
    """Return an experiment spec as YAML that no file holds; messages call it `name`, paths start at `folder`. Raises as `load`."""
    problems: list[Mistake] = []
    return _valid(read_text(text, name, folder, problems), folder / name, ExperimentSpec, (), findings, problems)


def _valid(written: Node, path: Path, model: type[M], overrides: Sequence[str], check: Check[M], problems: list[Mistake]) -> Loaded[M]:
    """Return a spec as written, resolved and validated; raises all `problems` at once, and those found here."""
    root = resolve(with_units(with_formulas(written, problems)) if model is ExperimentSpec else written, model, problems)
    try:
        spec = model.model_validate(plain(root))
        later = [locate(finding, root) for finding in check(spec)]
    except ValidationError as error:
        later = [*explain(error, root, model), *_beyond(error, root, model, check)]
    raise_if_any([*problems, *new_places(later, problems)])
    if isinstance(spec, ExperimentSpec) and path.is_file():  # else no file holds it, and no comments either
        spec._unconfirmed = questions_in(path.read_text(encoding="utf-8-sig"))
    return Loaded(spec, path, path.parent, tuple(overrides), root)


_QUESTION = re.compile(r"(?:^|(?<=\s))#[ \t]*CHECK:[ \t]*(?P<text>.*)$", re.MULTILINE)


_KEY = re.compile(r"^[ \t]*(?:- )?\{?([A-Za-z_]\w*):", re.MULTILINE)


def questions_in(text: str) -> tuple[str, ...]:
    """Return the open questions of a spec: its comments that begin with `CHECK`, each after the key that it is about."""
    found = []
    for match in _QUESTION.finditer(text):
        words = [match["text"]]
        key = _KEY.search(text, text.rfind("\n", 0, match.start()) + 1)  # of its line, or of the one that the comment stands above
        if not text[text.rfind("\n", 0, match.start()) + 1 : match.start()].strip():  # a comment above its line may go on
            below = text[match.end() + 1 :].splitlines()
            after = takewhile(lambda line: line.lstrip().startswith("# ") and "CHECK:" not in line, below)
            words += [line.strip().lstrip("# ") for line in after]
        found.append(" ".join([f"{key[1]}:" if key is not None else "", *words]).strip())
    return tuple(found)


def confirmed(text: str) -> str:
    """Return the text of a spec whose open questions are answered with yes: the comments stay, without `CHECK`."""
    return _QUESTION.sub(lambda match: f"# {match['text']}", text)


def resolved(spec: BaseModel, folder: Path | None = None, to: Path | None = None) -> str:
    """Return the spec as YAML that loads to an equal one; given both, that of a spec in `folder` for a file in the folder `to`."""
    document = spec.model_dump(mode="json", by_alias=True, exclude_none=True)
    if folder is not None and to is not None:
        document = moved(document, [Kind(type(spec))], folder.resolve(), to.resolve())
    return dump(escaped(document))


def _beyond(error: ValidationError, root: Node, model: type[M], check: Check[M]) -> list[Mistake]:
    """Return what `check` finds in a spec without its parts of wrong form, so that all mistakes are seen at once."""
    if error.error_count() > MOST_ERRORS:
        return []
    lost = set[str | int]()
    while True:
        unknown = unknown_keys(error, root, model)
        for loc in sorted(faulty(error, root), key=_last_items_first, reverse=True):
            meant = unknown.get(loc, loc)
            if meant is not None and _echoes(meant):
                return []
            root = without(root, loc)
            lost.add(loc[0])
        try:
            found = check(model.model_validate(plain(root), context=PARTIAL))
            return [locate(finding, root) for finding in found if not ("dictionary" in lost and finding.loc[:1] == ("fit",))]
        except ValidationError as still:  # what was left out was required: its section goes next
            error = still


def _echoes(loc: Loc) -> bool:
    """Return True where a loss would be missed elsewhere: a whole section, or a part of `data` that defines quantities or levels."""
    return len(loc) < 2 or (loc[0] == "data" and (len(loc) < 4 or loc[1] in ("files", "levels", "split")))


def _last_items_first(loc: Loc) -> tuple[tuple[int, str], ...]:
    """Sorts ways so that, in reverse, removing one list item leaves the numbers of those before it."""
    return tuple((step, "") if isinstance(step, int) else (0, step) for step in loc)
