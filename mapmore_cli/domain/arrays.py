"""Array types that every layer speaks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Measured or computed values; shapes are given where the array is used."""

IntArray = NDArray[np.int64]
"""Row numbers and identifiers."""

BoolArray = NDArray[np.bool_]
"""Masks over samples."""

Value = Array | np.float64
"""One number for every row, or one for all."""

Columns = Mapping[str, Array]
"""Quantities by canonical name, each `(n,)`, row for row of one table."""
