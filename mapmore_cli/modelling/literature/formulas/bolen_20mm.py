"""Bolen's static force of a 20 mm muscle with the published constants: the largest strain at 620 kPa alone is fitted. In kPa and N."""

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import Nonlinear

FORMULA = Formula(
    name="bolen_20mm",
    title="Bolen, 20 mm",
    reference="Bolen, Elzein, Pang, Hunt, Actuators 2026; constants of 20 mm muscles",
    inputs=("pressure", "strain"),
    parameters=("length", "e620"),
    text="922.4*atan(15.37*(length - 0.013))*(0.2579*(exp(-6.477*strain/e620) - 1) + pressure/620*exp(-1.321*(strain/e620)^2))",
    nonlinear=(Nonlinear("e620", per=None, intervals=((0.02, 0.6),)),),
    dimensions=("length",),
)
