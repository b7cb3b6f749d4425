"""Measured and predicted: over time for recordings of motion, as loops for a model with memory, else over the in-curve quantity."""

from __future__ import annotations

from mapmore_cli.reporting.figures.curves import held_out_figures
from mapmore_cli.reporting.figures.drawing import Drawing
from mapmore_cli.reporting.figures.loops import loop_figures
from mapmore_cli.reporting.figures.motion import motion_figures
from mapmore_cli.reporting.figures.training import training_figures
from mapmore_cli.reporting.inputs import ReportInputs


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return the figures of the fit that suit the study."""
    if inputs.has_memory:
        return [*loop_figures(inputs), *motion_figures(inputs)]
    return motion_figures(inputs) if inputs.over_time else [*held_out_figures(inputs), *training_figures(inputs)]
