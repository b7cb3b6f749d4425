"""Define formulas for viscous damping. The force is proportional to the strain rate, and in some
versions also to the pressure. Some versions have separate coefficients for rising and falling
pressure, or for regions of pressure.
"""

from collections.abc import Mapping
from dataclasses import replace

from mapmore_cli.modelling.literature.formula import Formula

DIRECTIONS = {
    "rise": "direction*(direction + 1)/2",
    "fall": "direction*(direction - 1)/2",
}
"""Expressions that are one if the pressure rises or falls (`direction` +1 and -1, M2 eq 16), and
zero otherwise. With `direction` 0, the muscle has not moved yet, so both are zero.
"""

PRESSURES = {
    "low": "(1 + sign(sign(200 - pressure) + 0.5))/2",
    "high": "(1 + sign(sign(pressure - 200) - 0.5))/2",
}
"""Expressions that are one up to 200 kPa, and above it."""


def by_region(local: Formula, regions: Mapping[str, str]) -> Formula:
    """Return a formula with separate parameters for each region, for example `B0_rise` instead of
    `B0`. Outside all regions, its value is zero. `regions` holds, for each region's name, an
    expression that is one inside the region and zero outside.
    """
    terms = []
    for region, inside in regions.items():
        of_region = local.text
        for name in local.parameters:
            of_region = of_region.replace(name, f"{name}_{region}")
        terms.append(f"{inside}*{of_region}")
    quantities = ("pressure", "strain_rate", "direction")
    return replace(
        local,
        inputs=tuple(name for name in quantities if any(name in term for term in terms)),
        parameters=tuple(f"{name}_{region}" for region in regions for name in local.parameters),
        text=" + ".join(terms),
    )


def viscous(
    name: str, title: str, reference: str, parameters: tuple[str, ...], viscosity: str, about: str
) -> Formula:
    """Return the formula for the damping force `viscosity*strain_rate`."""
    inputs = ("pressure", "strain_rate") if "pressure" in viscosity else ("strain_rate",)
    text = f"{viscosity}*strain_rate"
    return Formula(
        name, reference, inputs, parameters, text, title=title, about=about, component="damping"
    )


KERSCHER = "`pressure_viscous` is viscous damping in proportion to the pressure (Kerscher et al.)."
REYNOLDS = (
    "`reynolds` is viscous damping whose coefficient is a linear function of the pressure. It is "
    "fitted to rising and falling pressure separately (Reynolds et al.)."
)
CAO = (
    "`cao` is the formula `reynolds` with separate coefficients for two pressure regions, up to "
    "200 kPa and above 200 kPa (Cao et al.). The pressure must be in kPa."
)
FORMULAS = (
    Formula(
        name="none",
        title="none",
        reference="M2 section 5.3",
        inputs=(),
        parameters=(),
        text="0",
        component="damping",
        about=(
            "The damping force is zero. Every useful damping model has a smaller error than `none`."
        ),
    ),
    viscous(
        "linear_viscous",
        "Linear viscous",
        "M2 table 1",
        ("B0",),
        "B0",
        "`linear_viscous` is linear viscous damping (Tondu).",
    ),
    viscous("pressure_viscous", "Pressure viscous", "M2 table 1", ("B1",), "B1*pressure", KERSCHER),
    by_region(
        viscous("reynolds", "Reynolds", "M2 eq 16", ("B0", "B1"), "(B0 + B1*pressure)", REYNOLDS),
        DIRECTIONS,
    ),
    replace(
        by_region(
            viscous(
                "cao", "Cao", "M2 section 2.2 and table 1", ("B0", "B1"), "(B0 + B1*pressure)", CAO
            ),
            {
                f"{direction}_{pressure}": f"{moving}*{pressed}"
                for direction, moving in DIRECTIONS.items()
                for pressure, pressed in PRESSURES.items()
            },
        ),
        constants_for=("pressure",),
    ),
)
