"""Generalised kinetic friction with powers of the magnitude of the rate: unlike in `peternel`, every term turns with the motion."""

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import decay

FORMULA = Formula(
    name="peternel_absolute",
    title="Peternel, absolute",
    reference="M2 eq 24, with |strain_rate|^k",
    inputs=("strain_rate",),
    parameters=("B0", "B1", "B2", "B3", "B4"),
    text="sign(strain_rate)*(B0 + B1*abs(strain_rate) + B2*strain_rate^2 + B3*exp(-abs(strain_rate)/B4))",
    nonlinear=(decay("B4"),),
    component="damping",
)
