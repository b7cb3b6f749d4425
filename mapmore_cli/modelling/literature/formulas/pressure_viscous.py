"""Viscous damping in proportion to the pressure (Kerscher et al.)."""

from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="pressure_viscous",
    title="Pressure viscous",
    reference="M2 table 1",
    inputs=("pressure", "strain_rate"),
    parameters=("B1",),
    text="B1*pressure*strain_rate",
    component="damping",
)
