"""Kinetic friction that decays with speed, after Tondu and after Peternel."""

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import Nonlinear

DECAY = (1e-3, 10.0)
"""Bounds of a decay over the largest rate: below, it acts on the samples at rest alone; above, it
is straight to within a twentieth.
"""


def friction(
    name: str, title: str, reference: str, parameters: tuple[str, ...], text: str, about: str
) -> Formula:
    """Return a friction that opposes the motion with the force `text`; the last of its parameters
    is the rate over which it decays.
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
        "M2 table 1, with |strain_rate|",
        ("B0", "B1", "B2"),
        "(B0 - B1)*exp(-abs(strain_rate)/B2) + B1",
        """Kinetic friction, from B0 at rest to B1 at speed (Tondu).

Table 1 prints `exp(-strain_rate/B2)`, which grows without bound where the muscle extends; here it
is the magnitude of the rate, as in
M2 eq 24.""",
    ),
    friction(
        "peternel",
        "Peternel",
        "M2 eq 24",
        ("B0", "B1", "B2", "B3", "B4"),
        "B0 + B1*strain_rate + B2*strain_rate^2 + B3*exp(-abs(strain_rate)/B4)",
        """Generalised kinetic friction as printed, with powers of the signed rate (Peternel et
        al.).

So the term of B1 is `|strain_rate|`: the same force whether the muscle contracts or extends, where
all others oppose the motion.""",
    ),
    friction(
        "peternel_absolute",
        "Peternel, absolute",
        "M2 eq 24, with |strain_rate|^k",
        ("B0", "B1", "B2", "B3", "B4"),
        "B0 + B1*abs(strain_rate) + B2*strain_rate^2 + B3*exp(-abs(strain_rate)/B4)",
        "Generalised kinetic friction with powers of the magnitude of the rate: unlike in "
        "`peternel`, every term turns with the motion.",
    ),
)
