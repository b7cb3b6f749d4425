"""Bolen's static force of a 10 mm muscle with the published constants: the largest strain at 620 kPa alone is fitted. In kPa and N."""

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import Nonlinear

FORMULA = Formula(
    name="bolen_10mm",
    title="Bolen, 10 mm",
    reference="Bolen, Elzein, Pang, Hunt, Actuators 2026; constants of 10 mm muscles",
    inputs=("pressure", "strain"),
    parameters=("length", "e620"),
    text="303.5*atan(19.03*(length - 0.0075))*(0.5682*(exp(-4.254*strain/e620) - 1) + pressure/620*exp(-0.5597*(strain/e620)^2))",
    nonlinear=(Nonlinear("e620", per=None, intervals=((0.02, 0.6),)),),
    dimensions=("length",),
)
