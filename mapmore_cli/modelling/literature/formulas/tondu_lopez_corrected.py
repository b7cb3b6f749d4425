"""Tondu and Lopez' static force with a factor on the strain, for the muscle's ends that do not stay cylindrical.

The factor depends on the pressure, which must be in kPa. As in `tondu_lopez`, the area pi D^2/4 is fitted; W fits theta, a_k and b_k alone.
"""

from mapmore_cli.modelling.literature.braid import ANGLE, CORRECTED_STRAIN, CORRECTION, braid
from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="tondu_lopez_corrected",
    title="Tondu and Lopez, corrected",
    reference="W eq 8 with 10",
    inputs=("pressure", "strain"),
    parameters=("area", "theta", "a_k", "b_k"),
    text=f"area*pressure*{braid(CORRECTED_STRAIN)}",
    nonlinear=(ANGLE, *CORRECTION),
)
