"""First-order pressure-dependent viscous damping, fitted to rise and fall by themselves (Reynolds et al.)."""

from mapmore_cli.modelling.literature.cells import DIRECTIONS
from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.piecewise import by_region

FORMULA = by_region(
    Formula(
        name="reynolds",
        title="Reynolds",
        reference="M2 eq 16",
        inputs=("pressure", "strain_rate"),
        parameters=("B0", "B1"),
        text="(B0 + B1*pressure)*strain_rate",
        component="damping",
    ),
    DIRECTIONS,
)
