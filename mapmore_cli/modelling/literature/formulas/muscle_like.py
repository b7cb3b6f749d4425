"""`muscle_like` is a force like that of a biological muscle. The pressure acts as the activation,
which is multiplied by a force-length factor and a force-velocity factor. A passive spring acts in
parallel.

The force is `F_PAM = P F f_la(l) f_v(v) + F f_lp(l)` (equations 4 and 5 of the paper H) with
`f_la = 1 + a0 l + a1 l^2 + a2 l^3`, `f_v = 1 + b0 v` and `f_lp = c0 + c1 l`. The units are those of
table I of the paper H: P is in kPa, l in m, v in m/s, F in N/kPa, c0 in kPa and c1 in kPa/m. The
elongation l is measured from the rest length of each muscle. The velocity v is *positive when the
muscle shortens*. If b0 is negative, a shortening muscle pulls less, because the factor f_v then
acts as a damper.

If F and the products of F with the other constants are taken as parameters, the formula is linear
in all parameters except b0. A search for b0 alone is therefore enough (variable projection). The
paper H searches all seven parameters with the simplex method (`method: simplex`).
"""

from mapmore_cli.modelling.literature.formula import Formula, LinearForm
from mapmore_cli.modelling.literature.problem import Nonlinear

# At the largest velocity, the factor `1 + b0 v` of the active force lies between -9 and 11.
# b0 may have both signs, because on a joint the user chooses the sign of the velocity.
DAMPING = Nonlinear("b0", per="velocity", intervals=((-10.0, -1e-4), (1e-4, 10.0)))

FORMULA = Formula(
    name="muscle_like",
    title="Muscle-like",
    reference="H eq 4-5",
    inputs=("pressure", "length", "velocity"),
    parameters=("F", "a0", "a1", "a2", "b0", "c0", "c1"),
    text=(
        "pressure*F*(1 + a0*length + a1*length^2 + a2*length^3)*(1 + b0*velocity) + F*(c0 + "
        "c1*length)"
    ),
    nonlinear=(DAMPING,),
    form=LinearForm(
        text=(
            "pressure*(k0 + k1*length + k2*length^2 + k3*length^3)*(1 + b0*velocity) + d0 + "
            "d1*length"
        ),
        linear=("k0", "k1", "k2", "k3", "d0", "d1"),
        printed={
            "F": "k0",
            "a0": "k1/k0",
            "a1": "k2/k0",
            "a2": "k3/k0",
            "b0": "b0",
            "c0": "d0/k0",
            "c1": "d1/k0",
        },
    ),
    component="dynamic",
)
