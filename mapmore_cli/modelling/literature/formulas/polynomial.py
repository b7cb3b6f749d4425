"""Polynomials; `a21` multiplies `strain^2*pressure^1`."""

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
    """Return the polynomial with the given powers of the quantities `of`."""
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
        "Second-order polynomial of pressure and strain, without a square of the pressure; "
        "`a21` multiplies `strain^2*pressure^1`.",
    ),
    polynomial_formula(
        3,
        "H section I, its reference 19",
        ("pressure", "length", "velocity"),
        tuple(powers for powers in product(range(3, -1, -1), repeat=3) if sum(powers) <= 3),
        """Third-order polynomial of pressure, length and velocity; `a210` multiplies
        `pressure^2*length^1*velocity^0`.

Sharbafi et al.'s dynamic model, which H compares itself with (its reference 19). The quantities are
those of `muscle_like`.""",
        "dynamic",
    ),
    polynomial_formula(
        5,
        "M1 section II",
        ("strain", "pressure"),
        tuple((i, degree - i) for degree in range(5, -1, -1) for i in range(degree, -1, -1)),
        """Fifth-order polynomial of pressure and strain (Tothova et al., as used in M1); `a21`
        multiplies `strain^2*pressure^1`.

It is plain least squares on the pressures as measured. With k training pressures only the powers
up to k - 1 of the pressure are told apart: the rank is 15, 18, 20, 21 with k = 3, 4, 5, 6, but for
how the measured pressures scatter, which a note says. This is why its prediction between few
training pressures is poor (M1 section IV).""",
    ),
)
