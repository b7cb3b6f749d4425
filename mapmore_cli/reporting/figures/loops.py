"""Paths of the target over the quantity that drives it, measured and predicted: hysteresis loops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.motion import MEASURED, shown_models
from mapmore_cli.reporting.figures.style import BLACK, DOUBLE, OWN_STYLE, ModelStyle, model_styles, places, shortened, some_of
from mapmore_cli.reporting.figures.thinning import envelope
from mapmore_cli.reporting.inputs import SINGLE, ReportInputs
from mapmore_cli.reporting.titles import title_of

MOST_RECORDINGS = 3
MOST_RIVALS = 2
POINTS_A_PATH = 600


def loop_figures(inputs: ReportInputs) -> list[Drawing]:
    """Draw a row of panels for each held-out recording: the run's own model over the measured loops, and its best competitors."""
    numbers = [i for i, curve in enumerate(inputs.dataset.curves) if curve.held_out.any()]
    shown = [numbers[i] for i in places(inputs, [inputs.dataset.curves[i].id for i in numbers], MOST_RECORDINGS)]
    if not shown:
        return []
    models = shown_models(inputs, MOST_RIVALS)
    styles = model_styles(models, inputs.style.palette)
    panels = tuple(_panel(inputs, number, model, styles[model]) for number in shown for model in models)
    grid = Grid(len(models), SINGLE if len(models) == 1 else DOUBLE, 2.3, common_y="row")
    what = f"Measured and predicted {inputs.target.name} over {inputs.in_curve.name}"
    left_out = some_of(len(shown), len(numbers), "recordings with held-out samples")
    best = f" The best {len(models) - 1} of {len(inputs.models) - 1} competitors are drawn." if len(models) < len(inputs.models) else ""
    caption = f"{what} along the held-out samples, in the order of time.{best}{left_out}"
    return [Drawing("loops", caption, f"{what}, held-out samples in the order of time.", panels, grid, tuple(_legend(styles)))]


def _panel(inputs: ReportInputs, number: int, model: str, style: ModelStyle) -> Panel:
    curve, along, target = inputs.dataset.curves[number], inputs.in_curve, inputs.target
    x, measured = curve.columns[along.name], curve.columns[inputs.dataset.target]
    predicted = inputs.validation.predictions[model][number]
    pieces = _held_out_pieces(curve)

    def on(axes: Sequence[Axes]) -> None:
        for piece in pieces:
            _path(axes[0], x[piece], measured[piece], color=BLACK, linewidth=MEASURED, zorder=2)
            _path(axes[0], x[piece], predicted[piece], color=style.colour, linewidth=OWN_STYLE.width, zorder=3)

    rows = np.concatenate(pieces)
    names = (f"{along.name} [{along.unit}]", f"{target.name} [{target.unit}]", f"{model} [{target.unit}]")
    data: dict[str, Values] = dict(zip(names, (x[rows], measured[rows], predicted[rows]), strict=True))
    title = f"{shortened(inputs.curve_label(curve), 22)}: {shortened(title_of(model), 24)}"
    return Panel(f"{curve.id} {model}", on, inputs.axis_label(along), (inputs.axis_label(target),), data, title)


def _path(ax: Axes, x: Array, y: Array, **look: object) -> None:
    rows = np.union1d(envelope(x, POINTS_A_PATH // 2), envelope(y, POINTS_A_PATH // 2))
    ax.plot(x[rows], y[rows], **look)  # type: ignore[arg-type]


def _held_out_pieces(curve: Curve) -> list[IntArray]:
    """Row numbers of every run of held-out samples of one recording."""
    pieces: list[IntArray] = []
    for rows in curve.logs:
        held = rows[curve.held_out[rows]]
        pieces += [piece for piece in np.split(held, np.flatnonzero(np.diff(held) > 1) + 1) if len(piece)]
    return pieces


def _legend(styles: dict[str, ModelStyle]) -> list[Line2D]:
    measured = Line2D([], [], color=BLACK, linewidth=MEASURED, label="measured")
    return [measured, *(Line2D([], [], color=style.colour, linewidth=OWN_STYLE.width, label=model) for model, style in styles.items())]
