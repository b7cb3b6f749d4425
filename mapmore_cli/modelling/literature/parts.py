"""Fits of a formula's parts, made one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from mapmore_cli.domain.fits import FormulaFit, Optimum

SEVERITY = ("converged", "at_bound", "stopped_by_limit", "rank_deficient", "failed")
"""The statuses of `FormulaFit`, the better ones first."""


def renamed(fit: FormulaFit, name: Callable[[str], str]) -> FormulaFit:
    """The fit with `name(parameter)` for every parameter."""
    return replace(
        fit,
        parameters={name(parameter): value for parameter, value in fit.parameters.items()},
        errors={name(parameter): value for parameter, value in fit.errors.items()},
        rivals=tuple(replace(r, parameters={name(parameter): value for parameter, value in r.parameters.items()}) for r in fit.rivals),
    )


def merged(name: str, parts: Mapping[str, FormulaFit]) -> FormulaFit:
    """The fit called `name` of independent parts, whose parameters have different names, by what their notes are headed with.

    Status and condition are those of the worst part; ranks, sums of squares and samples add up. A rival is that of one part, with the
    others as they are.
    """
    fits = parts.values()
    parameters = {parameter: value for fit in fits for parameter, value in fit.parameters.items()}
    sse = sum(fit.sse for fit in fits)
    return FormulaFit(
        name=name,
        parameters=parameters,
        errors={parameter: value for fit in fits for parameter, value in fit.errors.items()},
        status=max((fit.status for fit in fits), key=SEVERITY.index),
        method=", ".join(dict.fromkeys(fit.method for fit in fits)),
        rank=sum(fit.rank for fit in fits),
        condition=max(fit.condition for fit in fits),
        sse=sse,
        samples=sum(fit.samples for fit in fits),
        notes=tuple(f"{part}: {note}" for part, fit in parts.items() for note in fit.notes),
        rivals=tuple(Optimum({**parameters, **r.parameters}, sse - fit.sse + r.sse) for fit in fits for r in fit.rivals),
    )
