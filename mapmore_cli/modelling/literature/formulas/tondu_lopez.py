"""Tondu and Lopez' static force of a braided cylinder, from virtual work.

W eq 4 takes the area pi D^2/4 from the muscle's nominal diameter and fits the angle alone. Here the area is fitted too (in kPa and N it is
in 1e-3 m^2), so that no dimension is needed and the bladder's diameter need not be known: this can only fit better. It then is W eq 3 in
other parameters, and equals `chou_hannaford` wherever that describes a braid.
"""

from mapmore_cli.modelling.literature.braid import ANGLE, braid
from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="tondu_lopez",
    title="Tondu and Lopez",
    reference="W eq 4",
    inputs=("pressure", "strain"),
    parameters=("area", "theta"),
    text=f"area*pressure*{braid('strain')}",
    nonlinear=(ANGLE,),
)
