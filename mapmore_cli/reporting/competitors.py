"""What a page prints of competitors: their equations with numbers, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import Equation
from mapmore_cli.modelling.kinds import equations, rules
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.literature.model import formula_equations
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of

BLACK_BOX = (
    "It is a black box: what it has learnt is no formula of the inputs, so that there is nothing "
    "to print. It is fitted again, with the same seed, by another run of this study."
)
NOT_KNOWN = "It has no equation here."


@dataclass(frozen=True)
class Printed:
    """A competitor on a page: how it is computed (`words`), and its equations."""

    title: str
    words: tuple[str, ...]
    equations: tuple[Equation, ...] = ()


def printed_competitors(inputs: ReportInputs) -> tuple[Printed, ...]:
    """Return every competitor that could be fitted, in the order of the scores."""
    failed = inputs.failed
    return tuple(_printed(name, inputs) for name in inputs.models[1:] if name not in failed)


def _printed(name: str, inputs: ReportInputs) -> Printed:
    """Return a competitor; the parts of a sum that are fitted one after the other are printed one
    below the other.
    """
    title, model = title_of(name), inputs.validation.models.get(name)
    formulas = inputs.validation.formulas
    parts = [fit for key, fit in formulas.items() if key in (name, f"{name} ({fit.name})")]
    parts += [formulas[key] for key in (f"{name} (static)", f"{name} (damping)") if key in formulas]
    try:
        if model is not None:
            return Printed(title, (*rules(model), *model.notes), equations(model))
        if parts:
            return Printed(title, (), tuple(e for fit in parts for e in formula_equations(fit, {})))
    except MapmoreError as fault:  # the plug-in of its formula is gone
        return Printed(title, (f"It cannot be printed: {fault.message}.",))
    return Printed(title, (BLACK_BOX if name in LEARNERS else NOT_KNOWN,))
