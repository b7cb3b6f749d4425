"""Kerscher et al.'s static force: Tondu and Lopez' with factors on the strain and on the force.

The factor on the force, `mu = a_e exp(-40 strain) - b_e` (W eq 11, strain as a fraction), takes the area pi D^2/4 in: a_e and b_e are W's
times the area (in kPa and N in 1e-3 m^2), and the number of parameters is W's. The pressure must be in kPa (W eq 10).
"""

from mapmore_cli.modelling.literature.braid import ANGLE, CORRECTED_STRAIN, CORRECTION, braid
from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="kerscher",
    title="Kerscher",
    reference="W eq 9 with 10, 11",
    inputs=("pressure", "strain"),
    parameters=("theta", "a_k", "b_k", "a_e", "b_e"),
    text=f"(a_e*exp(-40*strain) - b_e)*pressure*{braid(CORRECTED_STRAIN)}",
    nonlinear=(ANGLE, *CORRECTION),
)
