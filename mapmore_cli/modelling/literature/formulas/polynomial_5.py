"""Fifth-order polynomial of pressure and strain (Tothova et al., as used in M1); `a21` multiplies `strain^2*pressure^1`.

With k training pressures only the powers up to k - 1 of the pressure are told apart: the rank is 15, 18, 20, 21 with k = 3, 4, 5, 6, and
the minimum-norm solution is taken; what nominally equal pressures scatter does not count (`Problem.at_levels`). This is why its
prediction between few training pressures is poor (M1 section IV).
"""

from mapmore_cli.modelling.literature.formula import Formula

ORDER = 5
POWERS = tuple((i, degree - i) for degree in range(ORDER, -1, -1) for i in range(degree, -1, -1))  # of strain, of pressure

FORMULA = Formula(
    name="polynomial_5",
    title="Polynomial 5",
    reference="M1 section II",
    inputs=("pressure", "strain"),
    parameters=tuple(f"a{i}{j}" for i, j in POWERS),
    text=" + ".join(f"a{i}{j}*strain^{i}*pressure^{j}" for i, j in POWERS),
)
