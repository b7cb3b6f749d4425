"""Define the static force of a cylinder in a braid of inextensible threads (W eq 1-3, 6-7, 10).
There are versions by Chou and Hannaford, by Tondu and Lopez, and by Kerscher.
"""

from __future__ import annotations

import math

from mapmore_cli.modelling.literature.formula import Formula, LinearForm
from mapmore_cli.modelling.literature.problem import Nonlinear

ANGLE = Nonlinear("theta", per=None, intervals=((math.radians(5.0), math.radians(85.0)),))
"""Angle of the threads to the axis at rest, in radians. With more than 54.7 degrees, a muscle
lengthens under pressure.

Towards zero, the force depends only on the ratio of the area to the squared angle, so angles below
five degrees are not searched.
"""

CORRECTION = (
    Nonlinear("a_k", per="strain", intervals=((0.01, 100.0),)),
    Nonlinear("b_k", per="strain", intervals=((-10.0, -0.01),)),
)
"""Bounds of the factor on the strain: it is positive and falls with the pressure, as in W's fits.
Other signs would reverse the strain.

The bounds are wide: W prints a_k = 3.55, but on points rebuilt from W eq 12, the least-squares fit
of eq 8 has 88, that is 17/max|strain|.
"""

CORRECTED_STRAIN = "(a_k*exp(-pressure/100) - b_k)*strain"
"""Strain with the factor of W eq 10, `k = a_k exp(-P) - b_k`, P in bar. The 100 is kPa/bar, so the
formula holds for a pressure in kPa only.
"""

AREA = f"{250.0 * math.pi!r}*diameter^2"
"""Area `pi D^2/4` in 1e-3 m^2, which is N/kPa, with the diameter in m."""


def braid(strain: str) -> str:
    """Return the text of `h (1 - strain)^2 - y` with `h = 3/tan(theta)^2` and `y = 1/sin(theta)^2`
    (W eq 6-7).
    """
    return f"(3*(1 - {strain})^2/tan(theta)^2 - 1/sin(theta)^2)"


def braided(
    name: str,
    title: str,
    reference: str,
    strain: str,
    correction: tuple[Nonlinear, ...],
    about: str,
    *,
    of_diameter: bool = False,
) -> Formula:
    """Return `area P braid(strain)` with a fitted area, or with the area of the muscle's diameter
    if `of_diameter` is true.

    In `braid`, y is equal to `1 + h/3`. If the diameter is known, the formula is therefore linear
    in h, and the angle follows from `theta = atan(sqrt(3/h))`.
    """
    added = tuple(parameter.name for parameter in correction)
    area, form = "area", None
    if of_diameter:
        area, printed = AREA, {"theta": "atan(sqrt(3/h))", **dict(zip(added, added, strict=True))}
        form = LinearForm(f"{AREA}*pressure*(h*((1 - {strain})^2 - 1/3) - 1)", ("h",), printed)
    return Formula(
        name,
        reference,
        ("pressure", "strain"),
        ("diameter" if of_diameter else "area", "theta", *added),
        f"{area}*pressure*{braid(strain)}",
        correction if of_diameter else (ANGLE, *correction),
        form,
        title=title,
        about=about,
        dimensions=("diameter",) if of_diameter else (),
        constants_for=(
            "strain",
            *(["pressure"] if correction or of_diameter else []),
            *(["force"] if of_diameter else []),
        ),
    )


FORMULAS = (
    Formula(
        name="chou_hannaford",
        title="Chou and Hannaford",
        reference="W eq 3",
        inputs=("pressure", "strain"),
        parameters=("c1", "c2"),
        text="pressure*(c1*(1 - strain)^2 - c2)",
        constants_for=("strain",),
        about="""`chou_hannaford` is Chou and Hannaford's static force of a braided cylinder. The
formula follows from the conservation of energy.

Equation 3 of the paper W is `F = P b^2 (3 L^2/b^2 - 1)/(4 pi n^2)` with the thread length b, the
number n of turns of a thread, and the length L = L0 (1 - strain). In `chou_hannaford`, b and n are
replaced by one lumped parameter for each power of L, so that the formula is linear in its
parameters:

```text
c1 = 3 L0^2/(4 pi n^2),     c2 = b^2/(4 pi n^2)
n = L0 sqrt(3/(4 pi c1)),   b = L0 sqrt(3 c2/c1)
```

No dimension of the muscle is therefore needed for the fit. With the pressure in kPa and the force
in N, the unit of c1 and c2 is 1e-3 m^2. A real braid has c1 > 0 and c2 > c1/3 (b > L0), but the
fit of `chou_hannaford` also allows other values of c1 and c2. `tondu_lopez` is the same formula
with other parameters, and its fit allows real braids only.""",
    ),
    braided(
        "tondu_lopez",
        "Tondu and Lopez",
        "W eq 4",
        "strain",
        (),
        """`tondu_lopez` is Tondu and Lopez' static force of a braided cylinder. The formula
follows from the principle of virtual work.

The paper W (equation 4) takes the area pi D^2/4 from the muscle's nominal diameter and fits only
the angle. In `tondu_lopez`, both the angle and the area are fitted. The diameter of the bladder
need not be known, and the training error cannot be larger than with a fixed area. With the pressure
in kPa and the force in N, the unit of the area is 1e-3 m^2. With a fitted area, `tondu_lopez` is
the same equation as `chou_hannaford`; only the parameters differ. `tondu_lopez` and
`chou_hannaford` give the same forces if the fitted parameters of `chou_hannaford` describe a real
braid.""",
    ),
    braided(
        "tondu_lopez_fixed_area",
        "Tondu and Lopez, fixed area",
        "W eq 4, as printed",
        "strain",
        (),
        """`tondu_lopez_fixed_area` is Tondu and Lopez' static force as the paper W prints it.
The area is computed from the muscle's nominal diameter, and only the angle is fitted.

The equations are equation 4 of the paper W with its equations 6 and 7. In `tondu_lopez`, both the
area and the angle are fitted, so that `tondu_lopez` can describe the same forces as
`chou_hannaford`.""",
        of_diameter=True,
    ),
    braided(
        "tondu_lopez_corrected",
        "Tondu and Lopez, corrected",
        "W eq 8 with eq 10",
        CORRECTED_STRAIN,
        CORRECTION,
        """`tondu_lopez_corrected` is Tondu and Lopez' static force with a factor on the
strain, because the ends of the muscle do not stay cylindrical.

The factor on the strain depends on the pressure, which must be in kPa. As in `tondu_lopez`, the
area pi D^2/4 is fitted, whereas the authors of the paper W fit only theta, a_k and b_k.""",
    ),
    braided(
        "tondu_lopez_corrected_fixed_area",
        "Tondu and Lopez, corrected, fixed area",
        "W eq 8 with eq 10, as printed",
        CORRECTED_STRAIN,
        CORRECTION,
        """`tondu_lopez_corrected_fixed_area` is Tondu and Lopez' static force with a factor
on the strain, as the paper W prints it. The area is computed from the muscle's nominal diameter.

The equations are equations 8 and 10 of the paper W, in which theta, a_k and b_k are fitted. In the
formula `tondu_lopez_corrected`, the area is fitted as well.""",
        of_diameter=True,
    ),
    Formula(
        name="kerscher",
        title="Kerscher",
        reference="W eq 9 with eq 10 and 11",
        inputs=("pressure", "strain"),
        parameters=("theta", "a_k", "b_k", "a_e", "b_e"),
        text=f"(a_e*exp(-40*strain) - b_e)*pressure*{braid(CORRECTED_STRAIN)}",
        nonlinear=(ANGLE, *CORRECTION),
        constants_for=("pressure", "strain"),
        about="""`kerscher` is the formula of Tondu and Lopez for the static force, to which
Kerscher et al. have added one factor on the strain and another factor on the force.

The factor on the force is `mu = a_e exp(-40 strain) - b_e` (equation 11 of the paper W, with the
strain as a fraction). In `kerscher`, a_e and b_e are the parameters of the paper W multiplied by
the area pi D^2/4, because the data cannot separate the area from this factor. The fitted area
therefore needs no parameter of its own, and the formula has as many parameters as in the paper W.
With the pressure in kPa and the force in N, the unit of a_e and b_e is 1e-3 m^2. The pressure must
be in kPa, because the factor on the strain (equation 10 of the paper W) contains the pressure in
bar, which is computed here as the number of kPa divided by 100.""",
    ),
)
