"""Numbers of single precision: limited at both ends, and read as what they are."""

import numpy as np
import pytest

from mapmore_cli.annexes.exporting.dialect import DOUBLE, SINGLE

MOST = 3.4028234e38


@pytest.mark.parametrize(
    ("value", "text"),
    [
        *((0.1, "0.1f"), (-2.0, "-2.0f"), (1e300, f"{MOST!r}f"), (-np.inf, f"-{MOST!r}f")),
        *((0.99e-37, "0.0f"), (-0.99e-37, "0.0f"), (1.01e-37, "1.01e-37f"), (0.0, "0.0f")),
    ],
)
def test_numbers_of_single_precision(value, text):
    assert str(SINGLE.number(value)) == text
    assert np.isfinite(np.float32(text[:-1]))
    assert str(DOUBLE.number(value)) == repr(float(value))


def test_the_limits_are_those_of_the_format():
    assert np.float32(MOST) == np.finfo(np.float32).max
    assert np.finfo(np.float32).tiny < 1e-37
