"""Kinetic friction, from B0 at rest to B1 at speed (Tondu).

Table 1 prints `exp(-strain_rate/B2)`, which grows without bound where the muscle extends; here it is the magnitude of the rate, as in
M2 eq 24.
"""

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import decay

FORMULA = Formula(
    name="tondu_kinetic_friction",
    title="Tondu, kinetic friction",
    reference="M2 table 1, with |strain_rate|",
    inputs=("strain_rate",),
    parameters=("B0", "B1", "B2"),
    text="sign(strain_rate)*((B0 - B1)*exp(-abs(strain_rate)/B2) + B1)",
    nonlinear=(decay("B2"),),
    component="damping",
)
