"""No damping at all: what every damping model must beat."""

from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="none",
    reference="M2 section 5.3",
    inputs=(),
    parameters=(),
    text="0",
    component="damping",
    title="none",
)
