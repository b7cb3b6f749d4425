"""Make a state-space model of motion from a spec."""

from __future__ import annotations

from mapmore_cli.annexes.motion import model as motion
from mapmore_cli.annexes.motion.body import MotionFit
from mapmore_cli.annexes.motion.fitting import fit_motion
from mapmore_cli.annexes.motion.problem import MotionRecipe
from mapmore_cli.domain.declared import from_fields
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting.kinds import Given, Maker
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.modelling.memory.records import records_of, time_step


class MotionMaker(Maker):
    """Object that fits state-space models of motion to recordings and makes the fitted models."""

    def fit(self, part: ModelChoices, given: Given) -> FitResult:
        """Fit every section to all recordings.

        Raises DataError if recordings have different time steps, the input never changes, or a
        section has too few samples; SpecError if the solver refuses the sections; FitError if it
        finds no stable one.
        """
        curves = given.dataset.curves
        step = time_step(curves)
        recipe = from_fields(MotionRecipe, part.model, output=given.dataset.target, step=step)
        return FitResult(
            fit_motion(
                records_of(curves, step),
                recipe,
                lambda done, total: given.progress("sections", done, total),
            )
        )

    def build(self, part: ModelChoices, given: Given, result: FitResult) -> Model:
        """Return the model, with the training range of its inputs."""
        assert isinstance(result.body, MotionFit)
        return motion.build(
            part.name, result.body.model, given.segmentation, given.dataset.quantities, result.notes
        )
