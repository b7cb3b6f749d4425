"""Choose the points of a map to measure next, with a committee of formulas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.annexes.planning.folds import training_only
from mapmore_cli.annexes.planning.points import (
    Committee,
    MeasuredMap,
    next_points,
    picture,
    spread_out,
)
from mapmore_cli.annexes.planning.points import (
    until as more_points,
)
from mapmore_cli.annexes.planning.results import Candidate, Picture, Until
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, FitError, SpecError, UsageError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.backbone import fit_formula, pooled_training

COMMITTEE = ("sarosi_hinged", "sarosi")
"""Formulas that belong to the committee if the study has their inputs. A Gaussian process without a
formula always belongs to it.
"""

ASTRAY = 2.0
"""Largest width of the range of a formula's predictions over the map (together with the measured
values), as a multiple of the range of the measured values. A formula with a wider range is no
member of the committee.
"""

STEPS = {1: 201, 2: 41, 3: 13}
"""Steps of the grid along each input, by the number of inputs."""

MAP = (
    "On six measured maps, the error with such points was 0.3 to 1.2 times that with evenly spread "
    "points, 0.84 times on average (docs/planning.md)."
)
HALVES = "Half widths are right on average; a single one can be wrong by a factor of up to three."


Planned = tuple[tuple[Candidate, ...], Picture, Until | None, tuple[str, ...]]
"""Parts of a plan: the candidates, the best first; the half widths; the forecast, or None; and
notes.
"""


def check_prices(prices: Mapping[str, float], names: Sequence[str]) -> None:
    """Raise UsageError if a price is given for a quantity whose values the plan does not choose.
    `names` are the quantities that it chooses.
    """
    if wrong := next((name for name in prices if name not in names), None):
        raise UsageError(
            f"--cost {wrong}: the plan does not choose this quantity",
            f"name one of {', '.join(names)}",
        )


def of_points(
    choices: ModelChoices,
    whole: Dataset,
    count: int,
    wanted: float | None,
    prices: Mapping[str, float],
) -> Planned:
    """Return the next points to measure. Points that were measured already are not chosen, even if
    their samples are held out.
    """
    name, dataset = choices.name, training_only(whole)
    columns = pooled_training(dataset.curves)
    inputs = refit(choices, dataset).input_names
    names = tuple(quantity for quantity in inputs if np.ptp(columns[quantity]) > 0)
    if not names:
        raise DataError(
            f"{name}: all training samples have the same inputs, so that no range is known",
            "measure a second combination of inputs first",
        )
    if len(names) > max(STEPS):
        raise SpecError(
            f"{name}: a plan is possible for at most {max(STEPS)} inputs, but {len(names)} vary",
            "plan with a study in which the other inputs are constant",
        )
    check_prices(prices, names)
    x, y = spread_out(
        np.column_stack([columns[quantity] for quantity in names]), columns[dataset.target]
    )
    measured = MeasuredMap(names, x, y)
    steps = STEPS[len(names)]
    places = measured.grid(steps)
    known = [
        np.concatenate([curve.columns[quantity] for curve in whole.curves]) for quantity in names
    ]
    free = measured.unmeasured(places, np.column_stack(known), steps)
    if not free.any():
        raise DataError(
            f"{name}: all points of a grid with {steps} steps have been measured",
            "extend the range of an input, or measure the same points again",
        )
    formulas = formulas_of(dataset, measured, places)

    planned = Committee(measured, places, formulas)
    next_ones, halves = next_points(planned, names, count, prices, free)
    notes = (*([MAP] if len(names) == 2 else []), HALVES)
    until = None
    if wanted is not None:
        until = more_points(Committee(measured, places, formulas), wanted)
    return next_ones, picture(planned, measured, halves), until, notes


def formulas_of(
    dataset: Dataset, measured: MeasuredMap, places: Array
) -> dict[str, tuple[Array, Array]]:
    """Return the members of the committee by name, each with its predictions at the measured points
    and at the possible new points (`places`).

    The member `none` always exists. It predicts zero everywhere, so that its Gaussian process alone
    describes the measured values. A formula is no member if it predicts values far outside the
    range of the measured values (factor `ASTRAY`), which can happen with few points.
    """
    members = {"none": (np.zeros(len(measured.y)), np.zeros(len(places)))}
    for name in COMMITTEE:
        if set(literature.get(name).inputs) != set(measured.names) or dataset.target != "force":
            continue
        try:
            fit = fit_formula(name, dataset.curves, dataset.target)
        except (DataError, FitError):
            continue
        if not fit.failed:
            columns = (dict(zip(measured.names, at.T, strict=True)) for at in (measured.x, places))
            at_measured, at_places = (
                literature.of(fit).predict(fit.parameters, inputs) for inputs in columns
            )
            if np.ptp(np.append(measured.y, at_places)) <= ASTRAY * np.ptp(measured.y):
                members[name] = (at_measured, at_places)
    return members
