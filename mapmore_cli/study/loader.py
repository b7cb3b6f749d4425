"""Load a YAML file as a validated spec. Every value of the spec knows at which line and column of
the file it is written.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import takewhile
from pathlib import Path
from types import MappingProxyType
from typing import Generic, TypeVar

from pydantic import BaseModel, ValidationError

from mapmore_cli.storage.tables import RawTable
from mapmore_cli.study import checks
from mapmore_cli.study.diagnostics import (
    MOST_ERRORS,
    Finding,
    KeysAt,
    Mistake,
    explain,
    locate,
    lost,
    raise_if_any,
)
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.fields import Context, stray_variables
from mapmore_cli.study.layers import extended, with_formulas, with_overrides, with_units
from mapmore_cli.study.tree import (
    Loc,
    Node,
    SourceText,
    nearest,
    renamed,
    without,
    written,
)
from mapmore_cli.study.variables import VARIABLES, escaped
from mapmore_cli.study.yaml_dumper import dump
from mapmore_cli.study.yaml_loader import read_source


def findings(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield every mistake that shows only if several settings are compared, in an experiment whose
    values are valid one by one.
    """
    mistakes = list[Finding]()
    for each in spec.each:
        for check in checks.OF_EACH_TARGET:
            mistakes += [finding for finding in check(each) if finding not in mistakes]
    for check in checks.OF_WHOLE_STUDY:
        yield from check(spec)
    yield from mistakes


MODELINE, SCHEMA = "# yaml-language-server: $schema=", "mapmore.schema.json"
"""First line of a spec, by which editors find its schema, and name of the schema file that is
written beside the spec.
"""

M = TypeVar("M", bound=BaseModel)
Check = Callable[[M], Iterable[Finding]]
"""Function that looks for mistakes that no single field shows."""


@dataclass(frozen=True)
class Loaded(Generic[M]):
    """A valid spec, with the path of its file and the settings that were applied to it."""

    spec: M  # contents of the file, and defaults; all numbers are in the units of the model
    path: Path
    folder: Path  # folder at which relative paths of the spec start
    # settings that replace values of the file, for example `fit.max_terms=2`
    overrides: tuple[str, ...]
    _root: Node = field(repr=False, compare=False)
    tables: Mapping[str, RawTable] = field(default_factory=dict, repr=False, compare=False)

    @property
    def name(self) -> str:
        """Name of the spec in messages: the path of its file."""
        return self._root.at.source.name

    @cached_property
    def resolved(self) -> str:
        """The spec as YAML with all defaults. Inherited keys are included, variables are replaced
        by their values, and numbers are in the units of the model. If this YAML is loaded, the
        result equals this spec.
        """
        return self._text()

    def _text(self, given_only: bool = False, moved: tuple[Path, Path] | None = None) -> str:
        """Return the spec as YAML. If `moved` is given, a pair of folders, each path that is
        relative to the first folder is rewritten to be relative to the second.
        """
        document = self.spec.model_dump(
            mode="json",
            by_alias=True,
            exclude_none=True,
            exclude_defaults=given_only,
            context=moved,
        )
        return dump(escaped(document))

    def resolved_in(self, folder: Path, given_only: bool = False) -> str:
        """Return the spec as YAML for a file in another folder. Paths are rewritten to be relative
        to this folder, so that the spec can be run there.

        With `given_only`, defaults are left out. The first line of the spec is then kept if it
        names the schema for editors.
        """
        text = self._text(given_only, (self.folder.resolve(), folder.resolve()))
        first = self._root.at.source.text.partition("\n")[0]
        if not given_only or not first.startswith(MODELINE):
            return text
        schema = first.removeprefix(MODELINE).strip()
        place = (
            schema
            if "://" in schema
            else Path(os.path.relpath(self.folder / schema, folder)).as_posix()
        )
        return f"{MODELINE}{place}\n{text}"

    def where(self, *loc: str | int) -> str:
        """Return `file:line:column` of a key or list item. If a key is in no file, because it has
        its default value, the nearest section around it is used.
        """
        return str(nearest(self._root, loc).start)


LoadedSpec = Loaded[ExperimentSpec]
"""A valid experiment spec."""


def load(path: Path, overrides: Sequence[str] = ()) -> LoadedSpec:
    """Read an experiment spec, with `key.path=value` overrides on top.

    Raises SpecError with all mistakes at once, each with its place, the source line and the
    correction; UsageError for an override that does not have the form `key.path=value`.
    """
    return load_as(path, ExperimentSpec, overrides, findings)


def load_as(
    path: Path, model: type[M], overrides: Sequence[str] = (), check: Check[M] = lambda _: ()
) -> Loaded[M]:
    """Read a spec of any kind; raises the same errors as `load`."""
    return _validated(read_source(path), path, model, overrides, check)


def load_text(
    text: str,
    name: str,
    folder: Path,
    overrides: Sequence[str] = (),
    tables: Mapping[str, RawTable] = MappingProxyType({}),
) -> LoadedSpec:
    """Read an experiment spec from a YAML text that is not in a file. `name` is the name of the
    text in messages. Its paths are relative to `folder`. `tables` holds recordings in memory, which
    `data.files` names by their keys. Raises the same errors as `load`.
    """
    source = SourceText(name, folder, text, numbered=False)
    loaded = _validated(source, folder / name, ExperimentSpec, overrides, findings)
    return replace(loaded, tables=tables)


def changed(loaded: LoadedSpec, overrides: Sequence[str]) -> LoadedSpec:
    """Return the spec after further settings were applied; raises the same errors as `load`."""
    every = (*loaded.overrides, *overrides)
    source = loaded._root.at.source
    again = _validated(source, loaded.path, ExperimentSpec, every, findings)
    return replace(again, tables=loaded.tables)


def _validated(
    source: SourceText, path: Path, model: type[M], overrides: Sequence[str], check: Check[M]
) -> Loaded[M]:
    """Validate a text and return its spec. Raises SpecError with all mistakes at once. If several
    mistakes are at the same place, only the first is shown, because the others follow from it.
    """
    problems: list[Mistake] = []
    root = with_overrides(extended(source, path, problems), overrides, problems)
    if model is ExperimentSpec:
        root = with_units(with_formulas(root, problems))
    context, document = Context.of(root), written(root)
    try:
        spec = model.model_validate(document, context=context)
        later = [locate(finding, root) for finding in check(spec)]
    except ValidationError as error:
        keys_at = partial(context.keys_at, document)
        later = [
            *explain(error, root, keys_at),
            *_further_mistakes(error, root, keys_at, model, check),
        ]
    strays = stray_variables(root, context)
    problems += [Mistake(node.at, fault, VARIABLES) for node, fault in strays]
    known = {problem.at for problem in problems}
    raise_if_any([*problems, *(problem for problem in later if problem.at not in known)])
    # a spec that is not in a file has no comments
    if isinstance(spec, ExperimentSpec) and path.is_file():
        spec._unconfirmed = questions_in(path.read_text(encoding="utf-8-sig"))
    return Loaded(spec, path, path.parent, tuple(overrides), root)


def _further_mistakes(
    error: ValidationError, root: Node, keys_at: KeysAt, model: type[M], check: Check[M]
) -> list[Mistake]:
    """Return mistakes that the first validation could not find, so that all mistakes are shown at
    once. To find them, misspelt keys are corrected and faulty parts are removed, and the spec is
    validated again. If it is valid then, `check` looks for contradictions.
    """
    if error.error_count() > MOST_ERRORS:
        return []
    sections, below = set[str | int](), list[Mistake]()
    while True:
        # Remove the last items of a list first, so that the indices of the other items stay valid.
        parts = sorted(lost(error, root, keys_at), key=_place_among_items, reverse=True)
        misspelt = [(loc, meant[-1]) for loc, meant in parts if meant not in (None, loc)]
        for loc, key in misspelt:
            root = renamed(root, loc, key)
        # if a key was corrected, its section may now be complete, so nothing is removed yet
        for loc, meant in () if misspelt else parts:
            if meant is not None and _echoes(meant):
                return below
            root = without(root, loc)
            sections.add(loc[0])
        context, document = Context.of(root, partial=True), written(root)
        try:
            return below + [
                locate(finding, root)
                for finding in check(model.model_validate(document, context=context))
                if not ("dictionary" in sections and finding.loc[0] == "fit")
            ]
        # The part that was removed was required, so the section around it is removed next.
        except ValidationError as still:
            error, keys_at = still, partial(context.keys_at, document)
            below += explain(error, root, keys_at) if misspelt else []


def _echoes(loc: Loc) -> bool:
    """Return True if removing this part would cause mistakes elsewhere: it is a whole section, or a
    part of `data` that defines quantities or levels.
    """
    return len(loc) < 2 or (
        loc[0] == "data" and (len(loc) < 4 or loc[1] in ("files", "levels", "split"))
    )


def _place_among_items(part: tuple[Loc, Loc | None]) -> list[tuple[int, str]]:
    return [(step, "") if isinstance(step, int) else (0, step) for step in part[0]]


# Open questions
# --------------------------------------------------------------------------------------------------

_QUESTION = re.compile(r"(?:^|(?<=\s))#[ \t]*CHECK:[ \t]*(?P<text>.*)$", re.MULTILINE)
_KEY = re.compile(r"^[ \t]*(?:- )?\{?([A-Za-z_]\w*):", re.MULTILINE)


def questions_in(text: str) -> tuple[str, ...]:
    """Return the open questions of a spec: its comments that begin with `CHECK`, each with the key
    that it concerns.
    """
    questions = []
    # a search for the word `CHECK` is much faster than a search for comments
    for match in _QUESTION.finditer(text) if "CHECK" in text else ():
        words = [match["text"]]
        start = text.rfind("\n", 0, match.start()) + 1
        key = _KEY.search(text, start)  # the key is on the line of the comment or below
        # if the comment has a line of its own, it may continue on the next lines
        if not text[start : match.start()].strip():
            below = text[match.end() + 1 :].splitlines()
            after = takewhile(
                lambda line: line.lstrip().startswith("# ") and "CHECK:" not in line, below
            )
            words += [line.strip().lstrip("# ") for line in after]
        questions.append(" ".join([f"{key[1]}:" if key is not None else "", *words]).strip())
    return tuple(questions)


def confirmed(text: str) -> str:
    """Return the text of a spec without open questions. The comments stay, but the word `CHECK:` is
    removed from them.
    """
    return _QUESTION.sub(lambda match: f"# {match['text']}", text)
