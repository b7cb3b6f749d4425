"""Hill's contractile element as H prints it: activation, force over length, force over velocity.

H eq 1-3, `F_CE = A F_max f_l(l) f_v(v)` with `f_l = exp(c |(l - l_opt)/(l_opt w)|^3)`; over the
shortening velocity v, as in `muscle_like`, `f_v = (v_max - v)/(v_max + kappa v)` where the muscle
shortens and `N - (N - 1) (v_max + v)/(v_max - 7.56 kappa v)` where it lengthens (eq 3 has it
positive in lengthening, and v_max negative). The pressure is the activation.

c and w are one number, `c/w^3`: c is ln 0.05, as Geyer, Seyfarth and Blickhan have it, so that
f_l is 0.05 at the width w. F_max is in N a unit of pressure.
"""

from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.problem import Nonlinear

SHORTENING = "(velocity + abs(velocity))/2"
LENGTHENING = "(velocity - abs(velocity))/2"

FORMULA = Formula(
    name="hill",
    title="Hill",
    reference="H eq 1-3",
    inputs=("pressure", "length", "velocity"),
    parameters=("F_max", "l_opt", "w", "v_max", "kappa", "N"),
    # each branch of f_v is one at the other's velocities
    text=(
        "pressure*F_max*exp(-2.995732273553991*abs((length - l_opt)/(l_opt*w))^3)"
        f"*((v_max - {SHORTENING})/(v_max + kappa*{SHORTENING})"
        f" + (N - 1)*(1 - (v_max + {LENGTHENING})/(v_max - 7.56*kappa*{LENGTHENING})))"
    ),
    nonlinear=(
        Nonlinear("l_opt", per=None, intervals=((0.1, 10.0),), of="length"),
        Nonlinear("w", per=None, intervals=((0.05, 20.0),)),
        Nonlinear("v_max", per=None, intervals=((1.0, 100.0),), of="velocity"),
        Nonlinear("kappa", per=None, intervals=((0.1, 20.0),)),
        Nonlinear("N", per=None, intervals=((1.0, 3.0),)),
    ),
    component="dynamic",
)
