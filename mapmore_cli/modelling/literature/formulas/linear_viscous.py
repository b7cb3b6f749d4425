"""Linear viscous damping (Tondu)."""

from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="linear_viscous",
    title="Linear viscous",
    reference="M2 table 1",
    inputs=("strain_rate",),
    parameters=("B0",),
    text="B0*strain_rate",
    component="damping",
)
