"""The recordings that a spec names, before any is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.spec.models import FileEntry
from mapmore_cli.storage.readers.files import expand, relative_name, unique_ids


@dataclass(frozen=True)
class Source:
    """A file to read: its recording's id, its name relative to the spec's folder, and quantities that no column of it holds."""

    path: Path
    name: str
    id: str
    constants: Mapping[str, float]


def find_sources(entries: Sequence[str | FileEntry], folder: Path) -> tuple[Source, ...]:
    """Return the files of `data.files` in the order of the entries, those of one glob sorted by path.

    Raises DataError where a glob finds nothing or a file is named twice, SpecError where recordings share an id.
    """
    found: dict[str, tuple[Path, FileEntry]] = {}
    for entry in (FileEntry(path=entry) if isinstance(entry, str) else entry for entry in entries):
        paths = expand(entry.path, folder)
        if entry.id is not None and len(paths) > 1:
            raise SpecError(f"files: id '{entry.id}' is given to {len(paths)} files ({entry.path})", "Name a single file, or drop the id.")
        for path in paths:
            name = relative_name(path, folder)
            if name in found:
                raise DataError(
                    f"{name}: named twice, by '{found[name][1].path}' and '{entry.path}'", "Make the patterns of `files` disjoint."
                )
            found[name] = (path, entry)
    ids = [given.id or automatic for (_, given), automatic in zip(found.values(), unique_ids(list(found)), strict=True)]
    for name in ids:
        if ids.count(name) > 1:
            raise SpecError(f"files: {ids.count(name)} recordings have the id '{name}'", "Give each an `id` of its own.")
    return tuple(Source(path, name, id_, entry.set) for (name, (path, entry)), id_ in zip(found.items(), ids, strict=True))
