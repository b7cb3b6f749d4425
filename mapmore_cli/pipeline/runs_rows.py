"""The rows of the page of all runs, as the page itself holds them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from mapmore_cli.domain.scores import OWN, Alert

PAGE = "index.html"
MARK = '<script type="application/json" id="runs">'
"""What the rows of a page stand behind, and what tells it from a page of the user."""


@dataclass(frozen=True)
class Row:
    """One output of a run.

    - `nrmse`: by model, in per cent: of held-out data, where there are any.
    - `alerts`: what speaks against the number, the worst first.
    - `ended`: when the scores were written, in seconds since 1970.
    - `picture`: what was measured and predicted along a curve, as two paths of SVG.
    - `seconds`: how long each stage took when it last ran; pages of reports have no times, so that
      the same input gives the same bytes.
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
        """Name and NRMSE of the competitor that errs least."""
        others = [(name, error) for name, error in self.nrmse.items() if name != OWN]
        return min(others, key=lambda one: one[1], default=None)

    @property
    def day(self) -> str:
        """When it ended, to the minute."""
        return f"{datetime.fromtimestamp(self.ended, UTC):%Y-%m-%d %H:%M}"


def rows_of(place: Path) -> list[Row] | None:
    """Return the rows of a page: none where there is no page yet, None where another page is
    there.
    """
    if not place.exists() and not place.is_symlink():
        return []
    with suppress(OSError, ValueError, TypeError):
        _, mark, rest = place.read_text(encoding="utf-8").partition(MARK)
        if mark:
            return [
                Row(
                    **row
                    | {
                        "alerts": tuple(Alert(**one) for one in row["alerts"]),
                        "picture": tuple(row["picture"]),
                    }
                )
                for row in json.loads(rest.partition("</script>")[0])
            ]
    return None


def known_alerts(run_dir: Path) -> tuple[Alert, ...] | None:
    """Return the alerts of a run as the page of its folder has them, without reading its results;
    None where the page does not know these scores.
    """
    scores = run_dir / "scores.json"
    ended = scores.stat().st_mtime if scores.is_file() else None
    rows = rows_of(run_dir.parent / PAGE) or ()
    own = [row for row in rows if (row.run, row.ended) == (run_dir.name, ended)]
    return tuple(dict.fromkeys(one for row in own for one in row.alerts)) if own else None
