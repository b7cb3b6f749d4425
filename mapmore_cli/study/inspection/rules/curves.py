"""Rules about the shape of curves: whether a static model can follow them, and which quantity was set and which measured."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.modelling.validation.repeatability import WORTH, floors
from mapmore_cli.study.inspection.evidence import neighbourhood, set_in_steps
from mapmore_cli.study.inspection.rules import Issue, Subject

POSITIONS = ("strain", "displacement", "length")


def single_valued(subject: Subject) -> Iterator[Issue]:
    """Find loops: they have two values at one place, of which a static model has one, so that its error has a floor."""
    spec, dataset = subject.spec, subject.dataset
    if spec.target != "static" or spec.data.cycles is not None or dataset.level is None:
        return
    swept = [name for name in ("pressure", *POSITIONS) if name in dataset.quantities and name not in (dataset.level, dataset.target)]
    swept = [name for name in swept if any(np.ptp(curve.columns[name]) for curve in dataset.curves)][:1]
    if not swept:
        return
    found = floors(*([curve.columns[name] for curve in dataset.curves] for name in (swept[0], dataset.target)))
    told = [f"{100 * floor:.2g} % at {dataset.curves[number].id}" for number, floor in enumerate(found) if floor > WORTH]
    if told:
        best = f"no static model does better than {', '.join(told)} of the largest {dataset.target}"
        message = f"curves over {swept[0]} are not single-valued: {best}"
        remedy = f"where the muscle was loaded and unloaded, split the branches by `cycles: {{over: {swept[0]}}}`, or accept this floor"
        yield Issue("hint", "not-single-valued", subject.where("target"), message, remedy)


def loops_apart(subject: Subject) -> Iterator[Issue]:
    """Loops that do not follow from those at the next levels, so that no model of the level tells one that was not measured."""
    data, dataset = subject.spec.data, subject.dataset
    if subject.spec.target != "hysteresis" or data.cycles is None or dataset.level is None:
        return
    found = neighbourhood(dataset.curves, data.cycles.over, dataset.target)
    if found is not None and not found.tells:
        message = f"a loop hardly follows from those at the next levels ({found}): expect no more of a level that was not measured"
        surface = f"`segment: {{{dataset.level}: none}}`, with {dataset.level} in the dictionary"
        remedy = f"look whether all cycles were driven alike, and as often before; one smooth surface may err less ({surface})"
        yield Issue("hint", "loops-apart", subject.where("target"), message, remedy)


def wrong_way_round(subject: Subject) -> Iterator[Issue]:
    """Where the force was set and the length measured, the noise lies in the length, and force over strain may be a wall."""
    if subject.spec.target != "static" or not subject.has("force"):
        return
    position = next((name for name in POSITIONS if subject.has(name)), None)
    if position is None:
        return
    series = {name: [one.columns[name] for one in subject.recordings if one.rows_kept > 1] for name in ("force", position)}
    step = set_in_steps(series["force"])
    if step is not None and set_in_steps(series[position]) is None:
        steps = f"force goes in even steps of {step:.4g} {subject.units['force']} and {position} does not"
        message = f"{steps}: the force was set, and {position} measured"
        remedy = (
            f"try `target: {{column: {position}}}` with force among the inputs: the noise lies in the {position}; "
            "`validate: {as: force}` inverts the model, and scores it as force"
        )
        yield Issue("hint", "wrong-way-round", subject.where("target"), message, remedy)
