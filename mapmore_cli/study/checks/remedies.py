"""Define parts of findings that several checks use: the finding about an unknown name, and texts of
remedies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mapmore_cli.study.diagnostics import Finding, did_you_mean
from mapmore_cli.study.tree import Loc

NO_TIME = "add `time` to `columns`, or `sample_time` to `data`"

OF_NOTHING = "a model must not use its target as an input"

STATIC_RUN, REMOVE = "add `needs: {{static: my-static.yaml}}`", "remove it"

DERIVED = ("damping", "hysteresis")
"""Targets that are computed and that no column holds, so that terms cannot use their past
values.
"""


def unknown_quantity(
    name: str, have: Sequence[str], loc: Loc, offset: int = 0, on_key: bool = False
) -> Iterator[Finding]:
    """Yield a finding if `name` is no quantity of the study."""
    if name not in have:
        yield Finding(
            loc,
            f"there is no quantity `{name}` in this study",
            did_you_mean(name, have),
            offset,
            on_key,
        )
