"""Second-order polynomial of pressure and strain, without a square of the pressure; `a21` multiplies `strain^2*pressure^1`."""

from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="polynomial_2",
    title="Polynomial 2",
    reference="M2 eq 15",
    inputs=("pressure", "strain"),
    parameters=("a20", "a11", "a10", "a01", "a00"),
    text="a20*strain^2 + a11*strain*pressure + a10*strain + a01*pressure + a00",
)
