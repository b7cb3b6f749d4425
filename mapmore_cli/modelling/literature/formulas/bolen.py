"""`bolen` is Bolen's formula for the static force of a McKibben muscle, in which all constants are
fitted.

The source prints `F* = c0 (exp(-c1 e*) - 1) + P* exp(-c2 e*^2)`. F* is the force divided by the
force at 620 kPa and zero strain, e* is the strain divided by the largest strain at 620 kPa (e620),
and P* is the pressure divided by 620 kPa. If the data do not contain the strain e620, they
determine only the quotients `k1 = c1/e620` and `k2 = c2/e620^2`. Therefore k1 and k2 are fitted
instead of c1, c2 and e620.
"""

from mapmore_cli.modelling.literature.formula import Formula, LinearForm
from mapmore_cli.modelling.literature.problem import Nonlinear

SOURCE = "Bolen, Elzein, Pang, Hunt, Actuators 2026"

# For the two published muscles (largest strains 0.16 to 0.25), k1*max|strain| is between 4 and 7.
DECAY = Nonlinear("k1", per="strain", intervals=((1e-2, 50.0),))
BELL = Nonlinear("k2", per=None, intervals=((1e-2, 1e4),))


def published(diameter: int, largest: str, c0: float, c1: float, c2: float) -> Formula:
    """Return the formula with the published constants for one diameter, in mm. `largest` is the
    force at 620 kPa as an expression of the rest length.
    """
    return Formula(
        name=f"bolen_{diameter}mm",
        title=f"Bolen, {diameter} mm",
        reference=f"{SOURCE}, with the constants of {diameter} mm muscles",
        about=(
            f"This formula is Bolen's static force of a {diameter} mm muscle with the "
            "published constants. Only `e620`, the largest strain at 620 kPa, is fitted. The "
            "pressure must be in kPa, and the force is in N."
        ),
        inputs=("pressure", "strain"),
        parameters=("length", "e620"),
        text=(
            f"{largest}*({c0}*(exp(-{c1}*strain/e620) - 1) + "
            f"pressure/620*exp(-{c2}*(strain/e620)^2))"
        ),
        nonlinear=(Nonlinear("e620", per=None, intervals=((0.01, 1.0),)),),
        dimensions=("length",),
        constants_for=("pressure", "strain", "force"),
    )


FORMULAS = (
    Formula(
        name="bolen",
        title="Bolen",
        reference=SOURCE,
        inputs=("pressure", "strain"),
        parameters=("F620", "c0", "k1", "k2"),
        text="F620*(c0*(exp(-k1*strain) - 1) + pressure/620*exp(-k2*strain^2))",
        nonlinear=(DECAY, BELL),
        form=LinearForm(
            text="a*(exp(-k1*strain) - 1) + b*pressure*exp(-k2*strain^2)",
            linear=("a", "b"),
            printed={"F620": "620*b", "c0": "a/(620*b)", "k1": "k1", "k2": "k2"},
        ),
        constants_for=("pressure",),
    ),
    published(10, "303.5*atan(19.03*(length - 0.0075))", 0.5682, 4.254, 0.5597),
    published(20, "922.4*atan(15.37*(length - 0.013))", 0.2579, 6.477, 1.321),
)
