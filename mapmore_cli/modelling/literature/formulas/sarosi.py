"""Sárosi's empirical static force of a McKibben muscle."""

from dataclasses import replace

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import Intervals, Nonlinear

# Every author prints a negative exponent, so the force decays with the strain: a growing one may
# fit the training data better, and then dives beyond them. It is sought from almost straight to a
# decay within 1/50 of the largest strain. Published fits lie at a3*max|strain| of about -8 (W).
# Nearer to zero the exponential cannot be told from the linear terms, and a1, a2 grow without
# bound.
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
"""Sárosi and Fabulya's coefficients, W's starting values (section III), in kPa: they are for the
strain in per cent (`published` has them for a fraction), but W's strain is a fraction (`printed`
has the numbers as they stand)."""


def sarosi(letter: str, curvature: Intervals = DECAY) -> Formula:
    """Return the formula whose parameters are called by a letter and a number from 1 to 6, its
    exponent sought in the intervals of the `curvature`.
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
