"""Define the rows of the table on the page of all runs, and read them from the page. The page
contains the rows as JSON data.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mapmore_cli.checking.findings import FINDINGS
from mapmore_cli.domain.scores import OWN, Alert
from mapmore_cli.storage.atomic import content_of
from mapmore_cli.storage.run_record import DAMAGE, RUN_RECORD, read_json

PAGE = "index.html"
MARK = '<script type="application/json" id="runs">'
"""Text that stands before the rows in the page of all runs. If a page does not contain this text,
mapmore did not write it.
"""


@dataclass(frozen=True)
class RunRow:
    """Row of the table of all runs: one output of a run.

    - `nrmse`: NRMSE of each model in per cent, for the held-out data if there are any, otherwise
      for the training data.
    - `alerts`: sentences that warn about this NRMSE, the worst first.
    - `ended`: time at which the scores were written, in seconds since 1970.
    - `picture`: measured and predicted values along a curve, as two SVG paths.
    - `seconds`: duration of each stage when it last ran. This is stored only here, because the page
      of a single run contains no times, so that the same input gives the same bytes.
    - `mark`: hash of the files of the run from which the row was made (`mark_of`).
    """

    run: str
    muscle: str
    campaign: str
    data: str
    target: str
    split: str
    nrmse: dict[str, float]
    alerts: tuple[Alert, ...]
    ended: float
    picture: tuple[str, str]
    seconds: Mapping[str, float] = field(default_factory=dict)
    mark: str = ""

    @property
    def own(self) -> float | None:
        """NRMSE of the run's own model."""
        return self.nrmse.get(OWN)

    @property
    def best_other(self) -> tuple[str, float] | None:
        """Name and NRMSE of the competitor with the smallest error."""
        others = [(name, error) for name, error in self.nrmse.items() if name != OWN]
        return min(others, key=lambda pair: pair[1], default=None)

    @property
    def day(self) -> str:
        """Time at which the run ended, to the minute."""
        return f"{datetime.fromtimestamp(self.ended, UTC):%Y-%m-%d %H:%M}"


def rows_of(place: Path) -> list[RunRow] | None:
    """Return the rows of a page. If there is no page yet, the result is empty. For a page that
    mapmore did not write, the result is None.
    """
    if not place.exists() and not place.is_symlink():
        return []
    with suppress(OSError, ValueError, TypeError):
        _, mark, rest = content_of(place).decode().partition(MARK)
        if mark:
            return [
                RunRow(
                    **row
                    | {
                        "alerts": tuple(Alert(**alert) for alert in row["alerts"]),
                        "picture": tuple(row["picture"]),
                    }
                )
                for row in json.loads(rest.partition("</script>")[0])
            ]
    return None


OF_THE_MOMENT = ("seconds", "why", "mtime_ns", "ctime_ns", "inode")
"""Keys in the record of a run that differ if the same results are made a second time."""


def mark_of(run_dir: Path) -> str:
    """Return a hash of the record and the findings of a run. The record contains the hashes of all
    results, so that the mark changes if anything in a row of the run changes, apart from the number
    of open questions in its spec. The mark does not depend on when and why the stages ran.
    """
    marked = hashlib.sha256()
    with suppress(*DAMAGE):
        marked.update(json.dumps(_lasting(read_json(run_dir / RUN_RECORD))).encode())
    if (run_dir / FINDINGS).is_file():
        marked.update(content_of(run_dir / FINDINGS))
    return marked.hexdigest()


def _lasting(value: Any) -> Any:
    """Return a value of the record without the keys in `OF_THE_MOMENT`."""
    match value:
        case dict():
            return {key: _lasting(of) for key, of in value.items() if key not in OF_THE_MOMENT}
        case list():
            return [_lasting(of) for of in value]
    return value


def known_alerts(run_dir: Path) -> tuple[Alert, ...] | None:
    """Return the warnings about the scores of a run whose spec has no open questions, taken from
    the page of all runs, so that the results of the run need not be read. Return None if the page
    does not contain this run, if the run has changed since the page was written, or if its spec had
    open questions then.
    """
    rows, mark = rows_of(run_dir.parent / PAGE) or (), mark_of(run_dir)
    known = [row for row in rows if (row.run, row.mark) == (run_dir.name, mark)]
    alerts = tuple(dict.fromkeys(alert for row in known for alert in row.alerts))
    had_questions = any(alert.kind == "unconfirmed" for alert in alerts)
    return alerts if known and not had_questions else None
