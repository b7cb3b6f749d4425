"""Bolen's static force of a McKibben muscle, with all constants fitted.

As printed `F* = c0 (exp(-c1 e*) - 1) + P* exp(-c2 e*^2)`, of the force over that at 620 kPa and no strain, the strain over the largest at
620 kPa, and the pressure over 620 kPa. Data that do not reach that strain show
`k1 = c1/e620` and `k2 = c2/e620^2` alone, so these are fitted.
"""

from mapmore_cli.modelling.literature.formula import Formula, LinearForm
from mapmore_cli.modelling.literature.problem import Nonlinear

# The constants of the two published muscles, over the largest strains of 0.16 to 0.25, lie at k1*max|strain| of 4 to 7.
DECAY = Nonlinear("k1", per="strain", intervals=((1e-2, 50.0),))
BELL = Nonlinear("k2", per=None, intervals=((1e-2, 1e4),))

FORMULA = Formula(
    name="bolen",
    title="Bolen",
    reference="Bolen, Elzein, Pang, Hunt, Actuators 2026",
    inputs=("pressure", "strain"),
    parameters=("F620", "c0", "k1", "k2"),
    text="F620*(c0*(exp(-k1*strain) - 1) + pressure/620*exp(-k2*strain^2))",
    nonlinear=(DECAY, BELL),
    form=LinearForm(
        text="a*(exp(-k1*strain) - 1) + b*pressure*exp(-k2*strain^2)",
        linear=("a", "b"),
        printed={"F620": "620*b", "c0": "a/(620*b)", "k1": "k1", "k2": "k2"},
    ),
)
