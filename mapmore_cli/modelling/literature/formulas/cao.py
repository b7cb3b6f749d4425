"""Reynolds' damping in two pressure regions, up to 200 kPa and above, for rise and fall each (Cao et al.). The pressure must be in kPa."""

from mapmore_cli.modelling.literature.cells import DIRECTIONS, Condition, Region
from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.piecewise import by_region

PRESSURES = (Region("low", (Condition("pressure", "<=", 200.0),)), Region("high", (Condition("pressure", ">", 200.0),)))

FORMULA = by_region(
    Formula(
        name="cao",
        title="Cao",
        reference="M2 section 2.2 and table 1",
        inputs=("pressure", "strain_rate"),
        parameters=("B0", "B1"),
        text="(B0 + B1*pressure)*strain_rate",
        component="damping",
    ),
    tuple(direction & pressure for direction in DIRECTIONS for pressure in PRESSURES),
)
