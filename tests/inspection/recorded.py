"""Folders of made-up recordings, and what `init` makes of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.recording import Recording
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.study.loader import load

Columns = Mapping[str, Any]


def write(
    path,
    columns,
    head=None,
    mark=",",
):
    """Write columns as text, under their names or under `head`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    titles = mark.join(columns) + "\n" if isinstance(columns, Mapping) else ""
    values = np.broadcast_arrays(*(columns.values() if isinstance(columns, Mapping) else columns))
    rows = [mark.join(f"{value:.10g}" for value in row) for row in zip(*values, strict=True)]
    path.write_text((titles if head is None else head) + "\n".join(rows) + "\n")


def workbook(path, sheets):
    """Write rows of cells as sheets."""
    book = pytest.importorskip("openpyxl").Workbook()
    book.remove(book.active)
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(list(row))
    book.save(path)


def recording(name="r", log="", **columns):
    """A recording of these columns, all of whose rows were kept."""
    series = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in columns.values()))
    shared = dict(zip(columns, series, strict=True))
    return Recording(name, f"{name}.csv", shared, len(series[0]), {}, log)


def drafts(folder, **settings):
    """All drafts of a folder."""
    return [*start(folder, folder, **settings).drafts]


def drafted(folder, **settings):
    """The one draft of a folder; that of its hysteresis may stand beside it."""
    draft, *beside = drafts(folder, **settings)
    assert all(one.spec["target"] == "hysteresis" for one in beside)
    return draft


def loaded(draft, folder):
    """The spec of a draft, read from a file."""
    path = folder / f"{draft.name}.yaml"
    path.write_text(draft.text(), encoding="utf-8")
    return load(path)


def dataset_of(draft, folder):
    """The dataset of the spec of a draft."""
    return build_dataset(slice_of(loaded(draft, folder).spec), folder)


def checked(draft, folder):
    """The spec of a draft, of which `check` has hints at most."""
    spec = loaded(draft, folder)
    assert [issue for issue in inspect(spec).issues if issue.severity != "hint"] == []
    return spec
