"""What the geometric formulas share: a cylinder under a braid of threads that do not stretch (W eq 1-2, 6-7, 10)."""

from __future__ import annotations

import math

from mapmore_cli.modelling.literature.formula import LinearForm
from mapmore_cli.modelling.literature.problem import Nonlinear

ANGLE = Nonlinear("theta", per=None, intervals=((math.radians(5.0), math.radians(85.0)),))
"""Angle of the threads to the axis at rest, in radians; a muscle with more than 54.7 degrees lengthens under pressure.

Towards zero, only the ratio of the area to the squared angle remains, so nothing is to be found below five degrees.
"""

CORRECTION = (Nonlinear("a_k", per="strain", intervals=((0.01, 100.0),)), Nonlinear("b_k", per="strain", intervals=((-10.0, -0.01),)))
"""Bounds of the factor on the strain: it is positive and falls with the pressure, as in W's fits (other signs turn the strain around).

They are wide: W prints a_k = 3.55, but on points rebuilt from W eq 12 the least squares of eq 8 are at 88, 17/max|strain|.
"""

CORRECTED_STRAIN = "(a_k*exp(-pressure/100) - b_k)*strain"
"""W eq 10, `k = a_k exp(-P) - b_k` with P in bar: the 100 is kPa/bar, so the formula holds in kPa alone."""


AREA = f"{250.0 * math.pi!r}*diameter^2"
"""`pi D^2/4` in 1e-3 m^2, which is N/kPa, with the diameter in m."""


def braid(strain: str) -> str:
    """Text of `h (1 - strain)^2 - y`, with `h = 3/tan(theta)^2` and `y = 1/sin(theta)^2` (W eq 6-7)."""
    return f"(3*(1 - {strain})^2/tan(theta)^2 - 1/sin(theta)^2)"


def of_angle(strain: str, *others: str) -> LinearForm:
    """With the area given, `AREA P (h (1 - strain)^2 - y)` is linear in h, since `y = 1 + h/3`; the angle follows as `atan(sqrt(3/h))`.

    `others` are the parameters in the text of the strain.
    """
    return LinearForm(
        text=f"{AREA}*pressure*(h*((1 - {strain})^2 - 1/3) - 1)",
        linear=("h",),
        printed={"theta": "atan(sqrt(3/h))", **{name: name for name in others}},
    )
