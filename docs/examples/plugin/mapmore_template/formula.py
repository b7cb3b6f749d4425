"""Force that is proportional to the pressure and falls with a power of the strain."""

from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="power_law",
    title="Power law",
    reference="where it was published",
    inputs=("pressure", "strain"),
    parameters=("a", "b"),
    text="a*pressure*(1 - strain)^2 + b",
)
