"""Tondu and Lopez' static force with a factor on the strain, as W prints it: with the area of the muscle's nominal diameter.

W eq 8 with eq 10; theta, a_k and b_k are fitted. `tondu_lopez_corrected` is the same with the area fitted too.
"""

from mapmore_cli.modelling.literature.braid import AREA, CORRECTED_STRAIN, CORRECTION, braid, of_angle
from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="tondu_lopez_corrected_fixed_area",
    title="Tondu and Lopez, corrected, fixed area",
    reference="W eq 8 with 10, as printed",
    inputs=("pressure", "strain"),
    parameters=("diameter", "theta", "a_k", "b_k"),
    text=f"{AREA}*pressure*{braid(CORRECTED_STRAIN)}",
    nonlinear=CORRECTION,
    form=of_angle(CORRECTED_STRAIN, "a_k", "b_k"),
    dimensions=("diameter",),
)
