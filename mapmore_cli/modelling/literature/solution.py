"""What a fitting method hands back."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.domain.arrays import Array


@dataclass(frozen=True)
class Solution:
    """Linear parameters `beta`, `(m,)`, and coordinates `c`, `(k,)`, of a `Problem`; `status` and `method` as in `FormulaFit`."""

    beta: Array
    c: Array
    status: str
    method: str
    notes: tuple[str, ...] = ()
