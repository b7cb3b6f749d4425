"""Third-order polynomial of pressure, length and velocity; `a210` multiplies `pressure^2*length^1*velocity^0`.

Sharbafi et al.'s dynamic model, which H compares itself with (its reference 19). The quantities are those of `muscle_like`.
"""

from itertools import product

from mapmore_cli.modelling.literature.formula import Formula

ORDER = 3
INPUTS = ("pressure", "length", "velocity")
POWERS = tuple(powers for powers in product(range(ORDER, -1, -1), repeat=len(INPUTS)) if sum(powers) <= ORDER)


def _term(powers: tuple[int, ...]) -> str:
    factors = [f"{name}^{power}" for name, power in zip(INPUTS, powers, strict=True)]
    return "*".join([f"a{''.join(map(str, powers))}", *factors])


FORMULA = Formula(
    name="polynomial_3",
    title="Polynomial 3",
    reference="H section I, its reference 19",
    inputs=INPUTS,
    parameters=tuple(f"a{''.join(map(str, powers))}" for powers in POWERS),
    text=" + ".join(_term(powers) for powers in POWERS),
    component="dynamic",
)
