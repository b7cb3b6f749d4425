"""Write the `files` of a spec: globs, and the values that names of files contain."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mapmore_cli.annexes.drafting.draft import Draft, Named, Section
from mapmore_cli.annexes.drafting.names import NamedCondition
from mapmore_cli.annexes.drafting.studies import FolderStudy
from mapmore_cli.ingestion.globs import expand, relative_name


def patterns(files: Sequence[Path], folder: Path, bad: Iterable[Path] = ()) -> list[str]:
    """Return a list with one glob, relative to `folder`, that matches all `files`. It may also
    match some of the `bad` files, but no other file. If there is no such glob, return the names of
    all files.

    If folders or files at one position of the paths have different names, the glob has the words
    with which all these names begin and end, and `*` between them.
    """
    names = [relative_name(file, folder) for file in files]
    steps = [name.split("/") for name in names]
    if len(files) > 1 and len({len(step) for step in steps}) == 1:
        pattern = "/".join(_glob_of([*{*parts}]) for parts in zip(*steps, strict=True))
        matched = resolved(expand(pattern, folder, may_be_empty=True))
        if matched - resolved(bad) == resolved(files):
            return [pattern]
    return names


def resolved(files: Iterable[Path]) -> set[tuple[Path, str]]:
    """Return the resolved folder and the name of each file, so that different ways to write one
    path give equal results. Only the folders are resolved, because there may be thousands of files.
    """
    files = list(files)
    folders = {parent: parent.resolve() for parent in {file.parent for file in files}}
    return {(folders[file.parent], file.name) for file in files}


def _glob_of(parts: Sequence[str]) -> str:
    """Return a glob that matches all `parts`: the names of folders or files at one position of the
    paths.
    """
    if len(parts) == 1:
        return glob.escape(parts[0]) if parts[0] != ".." else ".."
    begin = os.path.commonprefix(parts).rstrip("0123456789")  # noqa: RUF071 - of letters
    end = os.path.commonprefix([part[::-1] for part in parts])[::-1]  # noqa: RUF071 - of letters
    mark = re.search(r"[_\s-]|(?:\.[A-Za-z]\w*)+$", end)
    return f"{glob.escape(begin)}*{glob.escape(end[mark.start() :]) if mark else ''}"


def started(
    study: FolderStudy,
    folder: Path,
    conditions: Sequence[NamedCondition] = (),
    remark: str = "",
    columns: Named | None = None,
) -> Draft:
    """Return a new draft with the name of the study and its files. Recordings with equal values in
    their names share an entry of `files`. Files whose columns have other names or units get their
    own `columns`. `remark` is a text about numbers in names that only count repetitions.
    """
    layout, changed = study.layout, study.changed_columns(columns or {})
    is_by_sheet = bool(study.parts[0][1]) and bool(conditions or layout.left)
    is_by_part = bool(layout.tables) or is_by_sheet
    entries = _file_entries(study, folder, conditions, is_by_part, changed)
    data: Section = {"files": entries, "reader": layout.reader, **layout.settings}
    if is_by_part and not layout.tables:
        del data["sheet"]
    draft = Draft({"schema_version": 1, "name": study.name, "data": data}, files=len(study.files))
    if not layout.settings.get("header", True):
        draft = draft.noted(("data", "header"), "the first line holds numbers")
    if "sample_time" in layout.settings:
        draft = draft.noted(("data", "sample_time"), "s: as the file says")
    if layout.is_map:
        draft = draft.noted(("data", "table"), "a map: each cell is a sample")
    if layout.left:
        why = f"left out because their layout differs: {', '.join(map(repr, layout.left))}"
        draft = draft.noted(("data", "sheet" if "sheet" in data else "reader"), why)
    if bad := _bad_among(study, folder, entries):
        why = "; ".join(bad[name] for name in sorted(bad))
        draft = draft.with_data("skip_bad_files", sorted(bad), why)
    reasons = (
        [f"names: {', '.join(condition.why for condition in conditions)}"] if conditions else []
    )
    if changed:
        reasons.append(f"{len(changed)} of {len(study.files)} files have other names or units")
    if layout.tables:
        reasons.append(f"each of the {len(layout.tables)} tables in a file is a recording")
    why = "; ".join(filter(None, [*reasons, remark]))
    sure = all(condition.sure for condition in conditions)
    return draft.noted(("data", "files"), why or None, sure)


def _file_entries(
    study: FolderStudy,
    folder: Path,
    conditions: Sequence[NamedCondition],
    is_by_part: bool,
    changed: Mapping[Path, Section],
) -> list[Any]:
    """Return the entries of `files` in a spec: globs, with the sheet or the number of the table,
    and the values that the names of the files contain. Files whose columns have other names or
    units get the entries of `columns` that `changed` holds for them.
    """
    values = [condition.in_model_units for condition in conditions]
    members: dict[tuple[Any, ...], list[Path]] = {}
    for at, (file, place) in enumerate(study.parts):
        part = tuple(place.items() if is_by_part else ())
        kind = (part, repr(changed.get(file)), tuple(series[at] for series in values))
        members.setdefault(kind, []).append(file)
    entries: list[Any] = []
    for (part, _, numbers), files in members.items():
        more: Section = dict(part)
        if files[0] in changed:
            more["columns"] = changed[files[0]]
        if numbers:
            more["set"] = dict(
                zip((condition.quantity for condition in conditions), numbers, strict=True)
            )
        paths = patterns(list(dict.fromkeys(files)), folder, study.bad)
        entries += [{"path": path, **more} for path in paths] if more else paths
    return entries


def _bad_among(study: FolderStudy, folder: Path, entries: Sequence[Any]) -> dict[str, str]:
    """Return the bad files that the globs of the entries match, by name, with the reasons."""
    if not study.bad:
        return {}
    named = {entry if isinstance(entry, str) else entry["path"] for entry in entries}
    globs = filter(glob.has_magic, named)
    matched = {place for pattern in globs for place in resolved(expand(pattern, folder, True))}
    return {
        relative_name(file, folder): reason
        for file, reason in study.bad.items()
        if matched & resolved([file])
    }
