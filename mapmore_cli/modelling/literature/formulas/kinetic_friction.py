"""Define two formulas for kinetic friction that decreases with speed, one by Tondu and one by
Peternel.
"""

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import Nonlinear

DECAY = (1e-3, 10.0)
"""Bounds of a decay rate as a fraction of the largest rate. Below the first, the decay affects only
the samples at rest; above the second, the decay differs from a straight line by less than a
twentieth.
"""


def friction(
    name: str, title: str, reference: str, parameters: tuple[str, ...], text: str, about: str
) -> Formula:
    """Return a formula for a friction force that opposes the motion. `text` is its magnitude. The
    last parameter is the strain rate that determines how fast the friction decreases with speed.
    """
    return Formula(
        name=name,
        title=title,
        reference=reference,
        inputs=("strain_rate",),
        parameters=parameters,
        text=f"sign(strain_rate)*({text})",
        nonlinear=(Nonlinear(parameters[-1], per=None, intervals=(DECAY,), of="strain_rate"),),
        component="damping",
        about=about,
    )


FORMULAS = (
    friction(
        "tondu_kinetic_friction",
        "Tondu, kinetic friction",
        "M2 table 1, but with |strain_rate| in the exponent",
        ("B0", "B1", "B2"),
        "(B0 - B1)*exp(-abs(strain_rate)/B2) + B1",
        """`tondu_kinetic_friction` is a kinetic friction that changes from B0 at rest to B1 at high
speed (Tondu).

Table 1 of the paper M2 prints `exp(-strain_rate/B2)`, which grows without bound when the muscle
extends. In `tondu_kinetic_friction`, the exponent contains `|strain_rate|` instead of
`strain_rate`, as in equation 24 of the paper M2.""",
    ),
    friction(
        "peternel",
        "Peternel",
        "M2 eq 24",
        ("B0", "B1", "B2", "B3", "B4"),
        "B0 + B1*strain_rate + B2*strain_rate^2 + B3*exp(-abs(strain_rate)/B4)",
        """`peternel` is the generalised kinetic friction of Peternel et al. as the paper M2 prints
it, with powers of the signed rate.

The term of B1 is therefore `B1*|strain_rate|`. This term has the same sign whether the muscle
contracts or extends, whereas all other terms oppose the motion.""",
    ),
    friction(
        "peternel_absolute",
        "Peternel, absolute",
        "M2 eq 24, but with |strain_rate|^k",
        ("B0", "B1", "B2", "B3", "B4"),
        "B0 + B1*abs(strain_rate) + B2*strain_rate^2 + B3*exp(-abs(strain_rate)/B4)",
        (
            "`peternel_absolute` is the generalised kinetic friction with powers of the magnitude "
            "of the rate. Unlike in `peternel`, every term opposes the motion."
        ),
    ),
)
