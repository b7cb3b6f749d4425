"""Prepare the equations of the competitors for a page, with the fitted values of the parameters. If
a competitor has no equations, the page shows the reason.
"""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.domain.models import Equation, Model
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import equations, rules
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.literature.model import formula_equations
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of

BLACK_BOX = (
    "It is a black box: what it has learnt is no formula of the inputs, so that there is nothing "
    "to print. It is fitted again, with the same seed, by another run of this study. It has the "
    "inputs of the model and, if the model has memory, delayed inputs. A black box with the same "
    "name in the table of a structure search may have other inputs, and is fitted to fewer samples."
)
NOT_KNOWN = (
    "It has no equation here, because it is no formula, or because the package that adds the "
    "formula is not installed."
)


@dataclass(frozen=True)
class Printed:
    """Competitor as it is printed on a page: sentences that say how it is computed (`words`), and
    its equations.
    """

    title: str
    words: tuple[str, ...]
    equations: tuple[Equation, ...] = ()


def printed_competitors(inputs: ReportInputs) -> tuple[Printed, ...]:
    """Return all competitors whose fit did not fail, in the order of the scores."""
    failed = inputs.failed
    return tuple(_printed(name, inputs) for name in inputs.models[1:] if name not in failed)


def _printed(name: str, inputs: ReportInputs) -> Printed:
    """Return a competitor as it is printed on a page. If it consists of several formulas that are
    fitted one after the other, all their equations are returned.
    """
    title, model = title_of(name), inputs.validation.models.get(name)
    if name in LEARNERS:
        return Printed(title, (BLACK_BOX,))
    if model is not None and is_known(model):
        return Printed(title, (*rules(model), *model.notes), equations(model))
    names = (name, f"{name} (static)", f"{name} (damping)")
    fits = [fit for key, fit in inputs.validation.formulas.items() if key in names]
    lines = [
        line for fit in fits if literature.is_known(fit) for line in formula_equations(fit, {})
    ]
    return Printed(title, () if lines else (NOT_KNOWN,), tuple(lines))


def is_known(model: Model) -> bool:
    """Return True if this program knows all formulas of a model. A package that added one of these
    formulas may no longer be installed.
    """
    return all(
        literature.is_known(part.backbone) for part in model.every if part.backbone is not None
    )
