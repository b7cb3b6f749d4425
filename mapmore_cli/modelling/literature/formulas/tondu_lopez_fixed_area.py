"""Tondu and Lopez' static force as W prints it: the area is that of the muscle's nominal diameter, and the angle alone is fitted.

W eq 4 with eq 6-7. `tondu_lopez` is the same with the area fitted too, which then is one model with `chou_hannaford`.
"""

from mapmore_cli.modelling.literature.braid import AREA, braid, of_angle
from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="tondu_lopez_fixed_area",
    title="Tondu and Lopez, fixed area",
    reference="W eq 4, as printed",
    inputs=("pressure", "strain"),
    parameters=("diameter", "theta"),
    text=f"{AREA}*pressure*{braid('strain')}",
    form=of_angle("strain"),
    dimensions=("diameter",),
)
