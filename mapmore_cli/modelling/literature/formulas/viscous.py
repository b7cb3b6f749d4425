"""Viscous damping: in proportion to the rate, to the pressure too, or to both by rise and fall and
by pressure.
"""

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.piecewise import DIRECTIONS, Condition, Region, by_region

PRESSURES = (
    Region("low", (Condition("pressure", "<=", 200.0),)),
    Region("high", (Condition("pressure", ">", 200.0),)),
)


def viscous(
    name: str, title: str, reference: str, parameters: tuple[str, ...], viscosity: str, about: str
) -> Formula:
    """Return the damping force `viscosity strain_rate`."""
    inputs = ("pressure", "strain_rate") if "pressure" in viscosity else ("strain_rate",)
    text = f"{viscosity}*strain_rate"
    return Formula(
        name, reference, inputs, parameters, text, title=title, about=about, component="damping"
    )


KERSCHER = "Viscous damping in proportion to the pressure (Kerscher et al.)."
REYNOLDS = (
    "First-order pressure-dependent viscous damping, fitted to rise and fall by themselves "
    "(Reynolds et al.)."
)
CAO = (
    "Reynolds' damping in two pressure regions, up to 200 kPa and above, for rise and fall "
    "each (Cao et al.). The pressure must be in kPa."
)
FORMULAS = (
    viscous(
        "linear_viscous",
        "Linear viscous",
        "M2 table 1",
        ("B0",),
        "B0",
        "Linear viscous damping (Tondu).",
    ),
    viscous("pressure_viscous", "Pressure viscous", "M2 table 1", ("B1",), "B1*pressure", KERSCHER),
    by_region(
        viscous("reynolds", "Reynolds", "M2 eq 16", ("B0", "B1"), "(B0 + B1*pressure)", REYNOLDS),
        DIRECTIONS,
    ),
    by_region(
        viscous(
            "cao", "Cao", "M2 section 2.2 and table 1", ("B0", "B1"), "(B0 + B1*pressure)", CAO
        ),
        tuple(direction & pressure for direction in DIRECTIONS for pressure in PRESSURES),
    ),
)
