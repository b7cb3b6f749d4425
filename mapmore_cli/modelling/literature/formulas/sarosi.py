"""`sarosi` is Sárosi's empirical formula for the static force of a McKibben muscle."""

from dataclasses import replace

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import Intervals, Nonlinear

# Bounds of a3*max|strain|. In every publication, the exponent a3 is negative (about -8 in W).
# With a positive exponent, the force would fall steeply outside the training data.
# If a3*max|strain| is -50, the exponential falls to 37 % within 1/50 of the largest strain.
# If a3*max|strain| is between -1e-3 and 0, the exponential is almost a straight line.
DECAY = ((-50.0, -1e-3),)

STARTS = {
    "published": {
        "a1": -0.09219,
        "a2": 203.701,
        "a3": -34.221042,
        "a4": -3.226,
        "a5": 1.09203,
        "a6": -208.372,
    },
    "printed": {
        "a1": -0.09219,
        "a2": 203.701,
        "a3": -0.34221042,
        "a4": -0.03226,
        "a5": 1.09203,
        "a6": -208.372,
    },
}
"""Coefficients of Sárosi and Fabulya in kPa, with which W starts its fits (section III). Sárosi and
Fabulya's strain is in per cent, but W's strain is a fraction. `published` holds the coefficients
converted to a fraction, and `printed` holds the numbers as printed.
"""


def sarosi(letter: str, curvature: Intervals = DECAY) -> Formula:
    """Return Sárosi's formula. Its parameters are named by `letter` and a number, for example `a1`
    to `a6`. The intervals `curvature` limit the search for the product of the exponent (`a3`) and
    max|strain|.
    """
    names = tuple(f"{letter}{number}" for number in range(1, 7))
    a1, a2, a3, a4, a5, a6 = names
    return Formula(
        name="sarosi",
        title="Sárosi",
        reference="M1 eq 1 = M2 eq 14 = W eq 12",
        inputs=("pressure", "strain"),
        parameters=names,
        text=(
            f"({a1}*pressure + {a2})*exp({a3}*strain) + {a4}*strain*pressure + {a5}*pressure + {a6}"
        ),
        nonlinear=(Nonlinear(a3, per="strain", intervals=curvature),),
    )


FORMULA = replace(sarosi("a"), published_starts=STARTS)
