"""The drift of a muscle over campaigns, as a figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.comparison import reference_points
from mapmore_cli.storage.atomic import write_bytes


def write_drift(path: Path, names: Sequence[str], models: Sequence[Model]) -> None:
    """Draw the output at reference points over the models, in their order; the format follows from the ending of `path`."""
    from mapmore_cli.reporting.figures.drawing import compose
    from mapmore_cli.reporting.figures.drift import drift_drawing
    from mapmore_cli.reporting.figures.saving import WRITERS
    from mapmore_cli.reporting.figures.style import figure_style

    drawing = drift_drawing(names, reference_points(models), models[0].output)
    with figure_style():
        write_bytes(path, WRITERS[path.suffix.removeprefix(".")](compose(drawing), drawing.name, drawing.alt))
