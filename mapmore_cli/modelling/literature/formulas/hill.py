"""`hill` is the contractile element of Hill's muscle model: its force is the product of an
activation, a force-length factor and a force-velocity factor.

The equations are equations 1 to 3 of the paper H. The force is `F_CE = A F_max f_l(l) f_v(v)` with
the force-length factor `f_l = exp(c |(l - l_opt)/(l_opt w)|^3)`. The pressure is the activation A,
and F_max is in N per unit of pressure.

The velocity v is positive in shortening, as in `muscle_like`. In equation 3 of the paper H, v has
the opposite sign, and v_max is negative. The force-velocity factor has two branches:

```text
f_v = (v_max - v)/(v_max + kappa v)                        in shortening
f_v = N - (N - 1) (v_max + v)/(v_max - 7.56 kappa v)       in lengthening
```

The data determine only the ratio `c/w^3`, and not c and w separately. Therefore c is set to ln
0.05, as Geyer, Seyfarth and Blickhan do it. The factor f_l is then 0.05 at the lengths that differ
from l_opt by `w l_opt`.
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
    # in lengthening, the first fraction is one; in shortening, the second summand is zero
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
