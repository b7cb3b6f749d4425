"""Predicted over measured values of all held-out samples."""

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.inputs import ReportInputs


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return one panel."""
    predicted = inputs.validation.predictions["mapmore"]
    curves = list(zip(inputs.dataset.curves, predicted, strict=True))
    x = np.concatenate([one.columns[inputs.target.name][one.held_out] for one, _ in curves])
    y = np.concatenate([values[one.held_out] for one, values in curves])
    unit = inputs.target.unit

    def on(ax: Axes) -> None:
        ax.plot(x, x, color="0.7")
        ax.plot(x, y, ".", markersize=2)

    data = {f"measured [{unit}]": x, f"predicted [{unit}]": y}
    panel = Panel("", on, f"Measured ({unit})", (f"Predicted ({unit})",), data)
    caption = "Predicted over measured values of all held-out samples."
    return [Drawing("scatter", caption, (panel,), Layout())]
