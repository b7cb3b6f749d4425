"""Generalised kinetic friction as printed, with powers of the signed rate (Peternel et al.).

So the term of B1 is `|strain_rate|`: the same force whether the muscle contracts or extends, where all others oppose the motion.
"""

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import decay

FORMULA = Formula(
    name="peternel",
    title="Peternel",
    reference="M2 eq 24",
    inputs=("strain_rate",),
    parameters=("B0", "B1", "B2", "B3", "B4"),
    text="sign(strain_rate)*(B0 + B1*strain_rate + B2*strain_rate^2 + B3*exp(-abs(strain_rate)/B4))",
    nonlinear=(decay("B4"),),
    component="damping",
)
