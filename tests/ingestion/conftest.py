"""A dataset made of small recordings."""

import pytest
from ingest_samples import spec_of

from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of


@pytest.fixture
def ingest(tmp_path):
    """`ingest({"a.csv": text}, levels=..., warnings=list)`: the dataset of these files; `files`
    defaults to all of them.
    """

    def run(
        recordings,
        *,
        target="static",
        units=None,
        warnings=None,
        **data,
    ):
        for name, content in recordings.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        spec = spec_of({"files": ["**/*.csv"], **data}, target=target, units=units or {})
        return build_dataset(
            slice_of(spec), tmp_path, warn=(warnings if warnings is not None else []).append
        )

    return run
