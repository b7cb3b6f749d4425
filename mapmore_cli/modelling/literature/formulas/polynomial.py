"""Define polynomials in two or three quantities. The digits in the name of a coefficient are
exponents: for example, `a21` multiplies `strain^2*pressure^1`.
"""

from itertools import product

from mapmore_cli.modelling.literature.formula import Formula

Powers = tuple[tuple[int, ...], ...]


def polynomial_formula(
    order: int,
    reference: str,
    of: tuple[str, ...],
    powers: Powers,
    about: str,
    component: str = "static",
) -> Formula:
    """Return a polynomial in the quantities `of`. `powers` holds, for each term, the exponent of
    every quantity.
    """
    names = tuple(f"a{''.join(map(str, each))}" for each in powers)
    monomials = (
        "*".join(f"{name}^{power}" for name, power in zip(of, each, strict=True)) for each in powers
    )
    return Formula(
        name=f"polynomial_{order}",
        title=f"Polynomial {order}",
        reference=reference,
        inputs=("pressure", *(name for name in of if name != "pressure")),
        parameters=names,
        text=" + ".join(
            f"{name}*{monomial}" for name, monomial in zip(names, monomials, strict=True)
        ),
        component=component,
        about=about,
    )


FORMULAS = (
    polynomial_formula(
        2,
        "M2 eq 15",
        ("strain", "pressure"),
        ((2, 0), (1, 1), (1, 0), (0, 1), (0, 0)),
        (
            "`polynomial_2` is a second-order polynomial of pressure and strain, without the "
            "square of the pressure. `a11` multiplies `strain^1*pressure^1`."
        ),
    ),
    polynomial_formula(
        3,
        "reference 19 of H (see section I of H)",
        ("pressure", "length", "velocity"),
        tuple(powers for powers in product(range(3, -1, -1), repeat=3) if sum(powers) <= 3),
        """`polynomial_3` is a third-order polynomial of pressure, length and velocity. `a210`
multiplies `pressure^2*length^1*velocity^0`.

This polynomial is the dynamic model of Sharbafi et al. (reference 19 of the paper H), with which
the paper H compares its own model. The quantities are those of `muscle_like`.""",
        "dynamic",
    ),
    polynomial_formula(
        5,
        "M1 section II",
        ("strain", "pressure"),
        tuple((i, degree - i) for degree in range(5, -1, -1) for i in range(degree, -1, -1)),
        """`polynomial_5` is a fifth-order polynomial of pressure and strain (Tothova et al., as
used in the paper M1). `a21` multiplies `strain^2*pressure^1`.

The polynomial is fitted by plain least squares at the measured pressures. With k training
pressures, the data determine only powers of the pressure up to k - 1. Of the 21 coefficients, the
data determine 15 if k is 3, 18 if k is 4, 20 if k is 5, and all if k is 6 or more. The number of
coefficients that the data determine is the rank of the fit. Scatter of the measured pressures can
raise the rank of the fit; a note then says so. Because of the missing powers, the polynomial
predicts poorly between few training pressures (section IV of the paper M1).""",
    ),
)
