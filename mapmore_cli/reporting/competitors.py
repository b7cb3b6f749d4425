"""Write the equations of competitors for the page."""

from __future__ import annotations

from mapmore_cli.domain.models import Equation
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.model import formula_equations
from mapmore_cli.modelling.simple import DEGREES, polynomial_fit
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of


def competitor_equations(inputs: ReportInputs) -> dict[str, Equation]:
    """Return the equations of the competitors that are formulas or polynomials, with their numbers,
    by title; `NAME: PART` for a formula with parts.
    """
    known = literature.names()  # the formula of a plugin that was removed is unknown
    fits = {
        name: fit
        for name, fit in inputs.validation.formulas.items()
        if not fit.failed and (fit.definition or fit.name in known)
    }
    if "backbone" in inputs.models and inputs.fit.formula is not None:
        fits["backbone"] = inputs.fit.formula
    shown: dict[str, Equation] = {}
    for name, fit in fits.items():
        parts = formula_equations(fit, {})
        title = title_of(name)
        shown |= {f"{title}: {part.id}" if parts[1:] else title: part for part in parts}
    quantities = (inputs.model.output, *inputs.model.inputs)
    names = [one.name for one in quantities if one.name != inputs.whole.target]
    for name in (one for one in inputs.models if one in DEGREES and one not in inputs.failed):
        if polynomial := polynomial_fit(DEGREES[name], inputs.whole, names):
            shown[title_of(name)] = polynomial.equation(name)
    return shown
