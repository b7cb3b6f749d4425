"""Format versions of files, and the versions of the tools that made them."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path

from mapmore_cli.domain.errors import DataError


def refuse_newer(path: Path, found: str, known: str) -> None:
    """Raise DataError where a file's major version is above the one that this program knows, or is no version at all."""
    try:
        major = int(found.split(".")[0])
    except ValueError:
        raise DataError(f"{path}: has the unreadable format version {found!r}", "delete it and run `mapmore run CONFIG`") from None
    if major > int(known.split(".")[0]):
        remedy = "update mapmore, or make the file again with this version by `mapmore run CONFIG --force`"
        raise DataError(f"{path}: was written in format {found} by a newer mapmore; this one reads up to {known}", remedy)


@cache
def tool_versions() -> Mapping[str, str]:
    """Versions of what decides about numbers and files, without importing any of it."""
    packages = {name: version(name) for name in ("mapmore", "numpy", "scipy", "h5py")}
    return {**packages, "python": platform.python_version()}
