"""A dataset made of small recordings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from ingest_samples import Ingest, spec_of

from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of


@pytest.fixture
def ingest(tmp_path: Path) -> Ingest:
    """`ingest({"a.csv": text}, levels=..., warnings=list)`: the dataset of these files; `files`
    defaults to all of them.
    """

    def run(
        recordings: Mapping[str, str | bytes],
        *,
        target: Any = "static",
        units: Any = None,
        warnings: list[str] | None = None,
        **data: Any,
    ) -> Dataset:
        for name, content in recordings.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        spec = spec_of({"files": ["**/*.csv"], **data}, target=target, units=units or {})
        return build_dataset(
            slice_of(spec), tmp_path, warn=(warnings if warnings is not None else []).append
        )

    return run
