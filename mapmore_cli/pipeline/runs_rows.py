"""Define the rows of the table on the page of all runs, and read them from the page. The page
contains the rows as JSON data.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from mapmore_cli.domain.scores import OWN, Alert
from mapmore_cli.storage.atomic import content_of

PAGE = "index.html"
MARK = '<script type="application/json" id="runs">'
"""Text that stands before the rows in the page of all runs. If a page does not contain this text,
mapmore did not write it.
"""


@dataclass(frozen=True)
class Row:
    """Row of the table of all runs: one output of a run.

    - `nrmse`: NRMSE of each model in per cent, for the held-out data if there are any, otherwise
      for the training data.
    - `alerts`: sentences that warn about this NRMSE, the worst first.
    - `ended`: time at which the scores were written, in seconds since 1970.
    - `picture`: measured and predicted values along a curve, as two SVG paths.
    - `seconds`: duration of each stage when it last ran. This is stored only here, because the page
      of a single run contains no times, so that the same input gives the same bytes.
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


def rows_of(place: Path) -> list[Row] | None:
    """Return the rows of a page. If there is no page yet, the result is empty. For a page that
    mapmore did not write, the result is None.
    """
    if not place.exists() and not place.is_symlink():
        return []
    with suppress(OSError, ValueError, TypeError):
        _, mark, rest = content_of(place).decode().partition(MARK)
        if mark:
            return [
                Row(
                    **row
                    | {
                        "alerts": tuple(Alert(**alert) for alert in row["alerts"]),
                        "picture": tuple(row["picture"]),
                    }
                )
                for row in json.loads(rest.partition("</script>")[0])
            ]
    return None


def known_alerts(run_dir: Path) -> tuple[Alert, ...] | None:
    """Return the warnings about the scores of a run, taken from the page of all runs, so that the
    results of the run need not be read. Return None if the page does not contain this run, or if
    the scores of the run have changed since the page was written.
    """
    scores = run_dir / "scores.json"
    ended = scores.stat().st_mtime if scores.is_file() else None
    rows = rows_of(run_dir.parent / PAGE) or ()
    known = [row for row in rows if (row.run, row.ended) == (run_dir.name, ended)]
    return tuple(dict.fromkeys(alert for row in known for alert in row.alerts)) if known else None
