"""Try a draft with the rules of `check` before it is written. No model is fitted. If there are many
files, the rules examine only some of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mapmore_cli.annexes.drafting.draft import Draft, Note, Section
from mapmore_cli.checking.applied import issues_of
from mapmore_cli.checking.findings import is_for_the_spec
from mapmore_cli.checking.rules.curves import FEWEST
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import find_sources, slice_of
from mapmore_cli.study.loader import load_text
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.yaml_dumper import dump


def checked(draft: Draft, plainer: Sequence[Draft], folder: Path) -> Draft:
    """Return a draft in which `check` finds no error: the given draft, otherwise the first of the
    simpler drafts in `plainer`. If `check` finds an error in all of them, and the user can correct
    the error in the spec, return the given draft with a note about the error at its target.

    Paths in all drafts are relative to `folder`. If there are many files, only a random part of
    them is examined, and a note says so. Raises DataError for an error that only other data can
    correct.
    """
    few, files = with_few_files(draft, folder)
    fault = _fault(few, folder)
    if few is not draft:
        usual = draft.notes.get(("data", "files"), Note(""))
        looked_at = f"`check` examined {MOST} of {files} files, drawn at random"
        why = "; ".join(filter(None, [usual.why, looked_at]))
        draft = draft.noted(("data", "files"), why, usual.sure)
    if fault is None:
        return draft
    for other in plainer:
        if _fault(with_few_files(other, folder)[0], folder) is None:
            why = (
                "simplified (no levels, and nothing is held out), because `check` found an "
                f"error: {fault.message}"
            )
            return other.noted(("target",), why, sure=False)
    if isinstance(fault, SpecError):
        why = f"`check` finds an error: {fault.message}; {fault.remedy}"
        return draft.noted(("target",), why, sure=False)
    raise DataError(f"{draft.name}: {fault.message}", fault.remedy)


MOST = 300
"""Largest number of files that the rules examine. If there are more, this number is drawn at
random.
"""


def with_few_files(draft: Draft, folder: Path) -> tuple[Draft, int]:
    """Return a copy of the draft with only `MOST` of its files, and the number of all files. The
    files are drawn at random with seed 1, but at least one file is drawn for each combination of
    values that names of files contain, for example for each level. The recordings keep their ids.
    If the draft holds out recordings or files by their names, nothing is held out in the copy,
    because it may not contain them.

    The draft is unchanged if it has at most `MOST` files, if another log is joined, or if names
    contain more than `MOST` different combinations of values.
    """
    data = Data.model_validate(draft.data)
    sources = find_sources(data.files, folder, data.join, bad=data.skip_bad_files)
    shuffled = np.random.default_rng(1).permutation(len(sources))
    first = {tuple(sources[at].constants.items()): at for at in shuffled[::-1]}
    if len(sources) <= MOST or data.join or len(first) > MOST:
        return draft, len(sources)
    drawn = [*dict.fromkeys([*first.values(), *shuffled])][:MOST]
    entries: list[Section] = [
        {
            "path": source.name,
            "id": source.id,
            "sheet": source.sheet,
            "table": source.table_below,
            "set": dict(source.constants),
            "columns": {
                name: column.model_dump(exclude_unset=True)
                for name, column in source.columns.items()
            },
        }
        for source in (sources[at] for at in sorted(drawn))
    ]
    few = draft.with_data("files", entries)
    held_out = draft.data.get("split", {}).get("validate", {})
    if "recordings" in held_out or "files" in held_out:
        few = few.without_data("split")
    return few, len(sources)


def _fault(draft: Draft, folder: Path) -> SpecError | DataError | None:
    """Return the error that would end `check`, or that would end the search for a structure because
    there are too few samples. Return None if there is no error.
    """
    try:
        loaded = load_text(dump(draft.spec), "draft.yaml", folder)
        dataset = build_dataset(slice_of(loaded.spec), folder)
        issues = issues_of(loaded, dataset)
    except (SpecError, DataError) as fault:
        return fault
    errors = [issue for issue in issues if issue.severity == "error"]
    if errors:
        kind = SpecError if is_for_the_spec(errors) else DataError
        message = "; ".join(f"{issue.message} [{issue.id}]" for issue in errors)
        return kind(message, errors[0].remedy)
    most = max(int(np.count_nonzero(curve.training)) for curve in dataset.curves)
    if "dictionary" in draft.spec or most >= FEWEST:
        return None
    return DataError(
        f"the search for a structure needs more training samples: the longest curve has {most}",
        "measure more, or name terms in a `dictionary` by hand",
    )
