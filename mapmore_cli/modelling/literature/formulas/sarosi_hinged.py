"""`sarosi_hinged` is Sárosi's formula with an additional plane for the slack muscle (the foot),
blended with the original (plain) formula. `sarosi_hinged` was made for mapmore, because the outlook
of the paper M1 suggests physics-based terms.

Measured muscles give almost no force below a threshold pressure, which rises with the strain. If
Sárosi's formula is fitted to data of such a muscle, the terms of the formula describe the forces
below the threshold instead of the larger forces. In `sarosi_hinged`, `hi` (Sárosi's formula with
the parameters a1 to a6) and the foot `lo = b0 + b1 P + b2 strain` are joined by a hinge of width w:

```text
F        = share F_hinged + (1 - share) F_plain
F_hinged = lo + w ln(1 + exp((hi - lo)/w))
```

F_plain is Sárosi's formula with the parameters s1 to s6, which is fitted to the same data as
F_hinged. `share` is the weight of F_hinged. The weight of each of the two parts is proportional to
`(r^2 + 0.01^2)^-2`, in which r is the training RMSE of the part divided by max|F|. If the data have
no foot, both parts are about equally good and have about equal weights. F_plain gets no weight if
its exponent s3 is at a bound or is not determined by the data. With such an exponent, the term
exp(s3 strain) of F_plain could be so large outside the measured strains that even a very small
weight would spoil the force. The strain must be a fraction and not in per cent. The reason is that,
if the data do not determine a3, the fit keeps a3 near a fixed value, which is about -33 and holds
for a strain that is a fraction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, root_mean_square
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.expressions import Expression, parse
from mapmore_cli.modelling.literature import hinge
from mapmore_cli.modelling.literature.formula import Formula, with_numbers
from mapmore_cli.modelling.literature.formulas.sarosi import DECAY, sarosi

# If the training RMSE of the hinged or plain part is below this fraction of max|F|, an even smaller
# RMSE hardly increases the weight of this part.
GOOD_ENOUGH = 0.01

PLAIN = sarosi("s", (*DECAY, (1e-3, 50.0)))  # the exponent s3 may be negative or positive
HIGH, LOW = sarosi("a").text, "b0 + b1*pressure + b2*strain"
PRINTED = f"share*({LOW} + w*log(1 + exp(({HIGH} - ({LOW}))/w))) + (1 - share)*({PLAIN.text})"
# This form cannot overflow, because ln(1 + exp(z)) = (z + |z|)/2 + ln(1 + exp(-|z|)).
COMPUTED = (
    f"share*(({HIGH} + {LOW} + abs({HIGH} - ({LOW})))/2 + w*log(1 + exp(-abs({HIGH} - "
    f"({LOW}))/w))) + (1 - share)*({PLAIN.text})"
)


class SarosiHinged(Formula):
    """Sárosi's hinged formula. It is fitted by `fit_hinge` instead of the general method. The
    printed equation is equivalent to the computed one, but easier to read.
    """

    def fit(self, columns: Columns, y: Array, method: str | None = None) -> FormulaFit:
        """Fit the hinged part by penalised least squares (`fit_hinge`), and blend it with the plain
        formula.

        `method` is the method for the plain formula. Each parameter has its standard error from the
        fit of the hinged or of the plain part. `share`, the weight of the hinged part, has no
        standard error. Status and condition number are those of the part with the larger weight.
        Raises the same errors as `Formula.fit`.
        """
        problem = self.problem(columns, y)
        columns, y = problem.columns, problem.y
        blended = self.near is not None and self.near["share"] < 1.0
        part = replace(PLAIN, near=self.near if blended else None)
        curvature = None if self.near is None else self.near["a3"]
        hinged, plain_fit = hinge.fit_hinge(columns, y, curvature), part.fit(columns, y, method)
        usable, largest = plain_fit.status == "converged", float(np.abs(y).max()) or 1.0
        unhinged = plain_fit.parameters if usable else dict.fromkeys(PLAIN.parameters, 0.0)
        parameters = {**hinged.parameters, "share": 1.0, **unhinged}
        alone = self.predict(parameters, columns), PLAIN.predict(plain_fit.parameters, columns)
        scatter = [root_mean_square(predicted - y) / largest for predicted in alone]
        if usable:
            parameters["share"] = 1.0 / (
                1.0 + ((scatter[0] ** 2 + GOOD_ENOUGH**2) / (scatter[1] ** 2 + GOOD_ENOUGH**2)) ** 2
            )
        share = parameters["share"]
        if share < 1.0:
            blend = (
                f"{share:.1%} hinged (training RMSE {scatter[0]:.2%} of the largest target), "
                f"{1 - share:.1%} plain ({scatter[1]:.2%})"
            )
        else:
            blend = (
                f"hinged alone (training RMSE {scatter[0]:.2%} of the largest target), as the "
                f"plain fit is {plain_fit.status}"
            )

        residual = self.predict(parameters, columns) - y
        unknown = float("nan")
        errors = plain_fit.errors if usable else dict.fromkeys(PLAIN.parameters, unknown)
        main = hinged if share > 0.5 else plain_fit
        return FormulaFit(
            name=self.name,
            parameters=parameters,
            errors={**hinged.errors, "share": unknown, **errors},
            status=main.status,
            method=hinged.method,
            rank=hinged.rank + (plain_fit.rank + 1 if share < 1.0 else 0),
            condition=main.condition,
            sse=float(residual @ residual),
            samples=len(y),
            notes=(hinged.notes[0], f"blend: {blend}", *hinged.notes[1:]),
        )

    def equation(self, fit: FormulaFit) -> Expression:
        """Return the fitted formula in the form that is easiest to read. If `hi - lo` is larger
        than 700 w, this form overflows. `predict` uses another form, which does not overflow.
        """
        return with_numbers(parse(PRINTED), fit.parameters)


FORMULA = SarosiHinged(
    name="sarosi_hinged",
    title="Sárosi, hinged",
    reference="mapmore, based on M1 eq 1",
    inputs=("pressure", "strain"),
    parameters=(*hinge.NAMES, "share", *PLAIN.parameters),
    text=COMPUTED,
    constants_for=("strain",),
)
