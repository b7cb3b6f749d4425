"""Draw measured and predicted values. Recordings of motion and models with memory are drawn over
time; models with memory are also drawn as loops. Everything else is drawn over the quantity that
varies within a curve.

Curves are drawn with the predictions above and the errors below, as in figures 9, 10, 12, 13 and 15
of Veale, Xie and Anderson 2018. The training curves of a static model are drawn together in one
panel.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Ends, IntArray
from mapmore_cli.domain.models import Formula, Pieces
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.domain.scores import OWN
from mapmore_cli.modelling.signals.sampling import envelope
from mapmore_cli.modelling.validation.intervals import INTERVAL
from mapmore_cli.reporting.figures import panels, style
from mapmore_cli.reporting.figures.drawing import DOUBLE, Drawing, Layout, Panel, Values
from mapmore_cli.reporting.figures.style import ModelStyle
from mapmore_cli.reporting.inputs import MOST_LINES, ReportInputs
from mapmore_cli.reporting.table import title_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_TIMED, MOST_LOOPS, MOST_SPANS, MOST_CURVES = 5, 3, 6, 10
"""Largest numbers: of models in a figure over time; of recordings, and of models, in a figure of
loops; of grey regions in a curve; and of training curves in a figure.
"""


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return the figures of the fit. The kind of study decides which figures are drawn."""
    curves = inputs.dataset.curves
    held_out = [
        i for i, curve in enumerate(curves) if curve.held_out.any() or curve.id in inputs.asked
    ]
    fits = curve_figures(inputs, "fit", held_out)
    if not inputs.timed:
        return [*fits, *training_figures(inputs)]
    loops = loop_figures(inputs) if inputs.has_memory else []
    others = [i for i in range(len(curves)) if i not in held_out]
    return [*loops, *fits, *curve_figures(inputs, "training", others)]


@dataclass(frozen=True)
class CurveFit:
    """Samples of one curve in the order in which they are drawn, (n,) each: measured `y` over `x`,
    and the prediction of every model.

    - `looks`: appearance of the line of each model.
    - `far_off`: models with errors so large that they are ignored in the scale of the axes.
    - `interval`: ends of the prediction intervals of the run's own model (the first model), or
      None.
    - `pieces`: rows of each recording of the curve if the curve is drawn over time, otherwise
      empty.
    - `shaded`: ranges of `x` with a grey background: plateaus, or held-out parts of a training
      curve.
    """

    title: str
    x: Array
    y: Array
    held_out: BoolArray
    predictions: Mapping[str, Array]
    looks: Mapping[str, ModelStyle]
    far_off: Sequence[str]
    interval: tuple[Array, Array] | None
    pieces: Sequence[IntArray]
    shaded: Sequence[Ends]

    def predicted(self, model: str) -> bool:
        """Return True if the model has predictions. If its fit failed, all its predictions are
        NaN.
        """
        return bool(np.isfinite(self.predictions[model]).any())

    def draw(self, top: Axes, bottom: Axes, words: tuple[str, str]) -> None:
        """Draw measured samples and a line for every model in the upper axes, and predicted minus
        measured values in the lower axes. `words` are the legend entries for held-out samples and
        for all other samples.

        Over time, measured samples are a line; otherwise they are dots, filled if they are held
        out. A model without prediction is not drawn. If the predictions of a model are far off, the
        axes are not made larger to show them.
        """
        panels.zero_line(bottom)
        self._draw_measured(top, words)
        draw_line = panels.draw_trace if self.pieces else panels.draw_band
        for rows in self.pieces or [np.arange(len(self.x))]:
            x, y = self.x[rows], self.y[rows]
            for model, look in self.looks.items():
                values, scales = self.predictions[model][rows], model not in self.far_off
                for ax, line in ((top, values), (bottom, values - y)):
                    if self.predicted(model):
                        draw_line(ax, x, line, sets_scale=scales, label=model, **look.line)
                    else:
                        label = f"{title_of(model)} (failed)"
                        ax.plot([], [], "x", color=look.colour, label=label)
            if self.interval is not None:
                own_model, look = next(iter(self.looks.items()))
                for ax, base in ((top, 0.0), (bottom, self.predictions[own_model][rows])):
                    ends = [end[rows] - base for end in self.interval]
                    label = f"{INTERVAL:.0%} interval"
                    panels.shade_between(ax, x, ends, look.colour, label)
        for low, high in self.shaded:
            label = "plateau" if self.pieces else ""
            for ax in (top, bottom):
                ax.axvspan(low, high, color=style.SHADE, zorder=-1, linewidth=0, label=label)

    def _draw_measured(self, ax: Axes, words: tuple[str, str]) -> None:
        marks = ((style.BLACK, style.BLACK), (style.GREY, "none"))
        for rows, label, (colour, face) in zip(
            (self.held_out, ~self.held_out), words, marks, strict=True
        ):
            look: dict[str, Any] = {"color": colour, "label": label, "zorder": 2}
            for piece in self.pieces if rows.any() else ():
                y = np.where(rows, self.y, np.nan)[piece]
                panels.draw_trace(ax, self.x[piece], y, linewidth=0.9, **look)
            if rows.any() and not self.pieces:
                look |= {"markersize": 2.2, "markeredgewidth": 0.5, "markerfacecolor": face}
                panels.draw_dots(ax, self.x[rows], self.y[rows], **look)


def curve_fit(inputs: ReportInputs, number: int, training: bool = False) -> CurveFit:
    """Return the data for drawing curve `number` of the dataset: its samples, and the predictions
    of the models that are drawn as lines. If `training` is True, the data contain only training
    samples and the run's own model.
    """
    curve, timed, ends = inputs.dataset.curves[number], inputs.timed, inputs.interval(number)
    x = curve.columns[_axis(inputs).name]
    rows = np.arange(curve.size) if timed else np.argsort(x, kind="stable")
    models = inputs.best(MOST_TIMED if timed else MOST_LINES)
    if training:
        rows, models = rows[~curve.held_out[rows]], models[:1]
    return CurveFit(
        inputs.curve_label(curve),
        x[rows],
        curve.columns[inputs.dataset.target][rows],
        curve.held_out[rows],
        {model: inputs.validation.predictions[model][number][rows] for model in models},
        style.model_styles(models, inputs.style.palette),
        [model for model in inputs.far_off if model in models],
        None if ends is None else (ends[0][rows], ends[1][rows]),
        curve.logs if timed else (),
        _plateaus(curve) if timed else held_out_spans(x[rows], curve.held_out[rows]),
    )


def _axis(inputs: ReportInputs) -> Quantity:
    """Return the quantity over which curves are drawn."""
    time = inputs.dataset.quantities.get("time", Quantity("time", "s"))
    return time if inputs.timed else inputs.in_curve


def held_out_spans(x: Array, held_out: BoolArray) -> list[Ends]:
    """Return the ranges of sorted `x` in which consecutive samples are held out, as (start, end).
    Each range reaches halfway to the neighbouring training samples. The list is empty if held-out
    samples are scattered among training samples, or if there are no training samples.
    """
    edges = np.flatnonzero(np.diff(held_out, prepend=False, append=False)).reshape(-1, 2)
    if held_out.all() or len(edges) > MOST_SPANS:
        return []
    middle = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
    return [(float(middle[start]), float(middle[end])) for start, end in edges]


def _plateaus(curve: Curve) -> list[Ends]:
    if curve.at_rest is None:
        return []
    times = [curve.columns["time"][rows[curve.at_rest[rows]]] for rows in curve.logs]
    return [(float(resting[0]), float(resting[-1])) for resting in times if len(resting)]


def curve_figures(inputs: ReportInputs, name: str, numbers: Sequence[int]) -> list[Drawing]:
    """Return a figure with a panel for each of the curves with these `numbers`: predictions above,
    errors below. Return an empty list if there are no curves.
    """
    shown = panels.some_curves(inputs, numbers)
    if not shown:
        return []
    curves = [curve_fit(inputs, number) for number in shown]
    words = ("held out", "training" if inputs.holds_out else "measured")
    if all(curve.held_out.all() for curve in curves):
        words = ("measured", "")
    figure = [
        Panel(
            inputs.dataset.curves[i].id,
            partial(curve.draw, words=words),
            inputs.axis_label(_axis(inputs)),
            _labels(inputs),
            curve_data(inputs, curve),
            curve.title,
        )
        for i, curve in zip(shown, curves, strict=True)
    ]
    which = "training" if name == "training" else "held-out"
    grid, parts, over = Layout(2.65, (2.0, 1.0), common_x=True, common_y="row"), "curves", ""
    thinned = panels.thinned([len(curve.x) for curve in curves])
    if inputs.timed:
        grid, parts, over = (
            Layout(2.5, (2.0, 1.0), columns=1, width=DOUBLE),
            "recordings",
            " over time",
        )
        thinned = ""
    caption = (
        f"Measured and predicted {inputs.target.name} of the {which} {parts}{over}, predicted "
        f"minus measured below.{_marks(inputs, curves)}{panels.interval_words(inputs)}{thinned}"
        f"{panels.some_of(len(shown), len(numbers), f'{which} {parts}')}"
        f"{panels.best_of(len(curves[0].looks), len(inputs.models))}"
        f"{panels.beyond_scale(curves[0].far_off)}{own_words(inputs)}"
    )
    return [Drawing(name, caption, tuple(figure), grid)]


def _labels(inputs: ReportInputs) -> tuple[str, str]:
    """Return the labels of the predictions and of the errors below them."""
    return inputs.axis_label(inputs.target), f"Error ({inputs.target.unit})"


def own_words(inputs: ReportInputs) -> str:
    """Return a sentence for a caption that says which model `mapmore` is if it has no pieces: a
    formula that was fitted to these data, or a sum of models of other runs. Otherwise return an
    empty text.
    """
    if inputs.own != OWN or isinstance(inputs.model.body, Pieces):
        return ""
    if isinstance(inputs.model.body, Formula):
        return f" {OWN} is {inputs.model.body.backbone.name}, fitted to the training samples here."
    others = ", ".join(part.name for part in inputs.model.body.models)
    return f" {OWN} is made of {others}." if others else ""


def _marks(inputs: ReportInputs, curves: Sequence[CurveFit]) -> str:
    """Return sentences for a caption that explain filled dots, grey lines and grey backgrounds."""
    mixed = any(curve.held_out.any() and not curve.held_out.all() for curve in curves)
    if not inputs.timed:
        words = " Filled dots and grey bands mark held-out samples, open dots training samples."
        return words if mixed else ""
    plateau = " The plateau is grey: it is scored, but not used for training."
    return (plateau if inputs.over_time else "") + (
        " The measured line is grey where samples are used for training." if mixed else ""
    )


def curve_data(inputs: ReportInputs, curve: CurveFit) -> dict[str, Values]:
    """Return the drawn data of a curve by heading: measured values, whether they are held out, and
    the predictions of every model.
    """
    unit, ends = inputs.target.unit, zip(("low", "high"), curve.interval or (), strict=False)
    return {
        panels.heading(_axis(inputs)): curve.x,
        panels.heading(inputs.target): curve.y,
        "data": np.where(curve.held_out, "validate", "train"),
        **{f"{model} [{unit}]": values for model, values in curve.predictions.items()},
        **{f"{inputs.own} {name} [{unit}]": end for name, end in ends},
    }


# Static models
# --------------------------------------------------------------------------------------------------


def training_figures(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure of the training curves: measured samples in a different colour for each
    curve, with the lines of the run's own model, and below them the errors in the same colours. If
    there are more than `MOST_CURVES` curves, some are chosen.
    """
    numbers = [i for i, curve in enumerate(inputs.dataset.curves) if not curve.held_out.all()]
    shown = [numbers[i] for i in panels.evenly(len(numbers), MOST_CURVES)]
    if not shown:
        return []
    model, curves = inputs.own, [curve_fit(inputs, number, training=True) for number in shown]
    columns, sizes = (
        [curve_data(inputs, curve) for curve in curves],
        [len(curve.x) for curve in curves],
    )

    def on(top: Axes, bottom: Axes) -> None:
        panels.zero_line(bottom)
        names = panels.told_apart([curve.title for curve in curves], 24)
        colours = style.level_colours(len(curves))
        for curve, name, colour in zip(curves, names, colours, strict=True):
            y, line = curve.predictions[model], curve.looks[model].colour
            if curve.predicted(model):
                panels.draw_band(top, curve.x, y, color=line, zorder=3, label=model)
                panels.draw_band(bottom, curve.x, y - curve.y, color=colour, linewidth=0.8)
            panels.draw_dots(top, curve.x, curve.y, color=colour, markersize=2.0, label=name)

    data = {"curve": np.repeat([curve.title for curve in curves], sizes)}
    data |= {name: np.concatenate([column[name] for column in columns]) for name in columns[0]}
    caption = (
        f"The training curves with {model} above, its error (predicted minus measured) below."
        f"{panels.thinned(sizes)}"
        f"{panels.some_of(len(curves), len(numbers), 'training curves')}{own_words(inputs)}"
    )
    panel = Panel("", on, inputs.axis_label(inputs.in_curve), _labels(inputs), data)
    return [Drawing("fit_training", caption, (panel,), Layout(2.95, (2.2, 1.0)))]


# Loops with memory
# --------------------------------------------------------------------------------------------------


def loop_figures(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure with a row of panels for each held-out recording. A row has a panel for the
    run's own model and for each of its best competitors. A panel shows the predicted loops over the
    measured loops.
    """
    numbers = [i for i, curve in enumerate(inputs.dataset.curves) if curve.held_out.any()]
    shown = panels.some_curves(inputs, numbers, MOST_LOOPS)
    if not shown:
        return []
    styles = style.model_styles(inputs.best(MOST_LOOPS), inputs.style.palette)
    loops = tuple(panel for i in shown for panel in _loops(inputs, i, styles))
    caption = (
        f"Measured and predicted {inputs.target.name} over {inputs.in_curve.name} along the "
        "held-out samples, in the order of time."
        f"{panels.best_of(len(styles), len(inputs.models))}"
        f"{panels.some_of(len(shown), len(numbers), 'recordings with held-out samples')}"
    )
    return [Drawing("loops", caption, loops, Layout(2.3, columns=len(styles), common_y="row"))]


def _loops(inputs: ReportInputs, number: int, styles: Mapping[str, ModelStyle]) -> Iterator[Panel]:
    """Yield a panel for each model in `styles`. Consecutive held-out samples are joined by a
    line.
    """
    curve, along, target = inputs.dataset.curves[number], inputs.in_curve, inputs.target
    x, measured = (curve.columns[name] for name in (along.name, inputs.dataset.target))
    held = [rows[curve.held_out[rows]] for rows in curve.logs]
    runs = [run for rows in held for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)]
    rows = np.concatenate(runs)

    def on(ax: Axes, model: str, predicted: Array) -> None:
        for run in runs:
            for y, label, ink, width in (
                (measured, "measured", style.BLACK, 0.9),
                (predicted, model, styles[model].colour, 1.6),
            ):
                path = run[np.union1d(*(envelope(z[run], 2 * panels.DOTS) for z in (x, y)))]
                ax.plot(x[path], y[path], color=ink, linewidth=width, label=label)

    for model in styles:
        predicted = inputs.validation.predictions[model][number]
        data = {
            panels.heading(along): x[rows],
            panels.heading(target): measured[rows],
            f"{model} [{target.unit}]": predicted[rows],
        }
        labels = (inputs.axis_label(along), (inputs.axis_label(target),))
        title = f"{inputs.curve_label(curve)}: {title_of(model)}"
        draw_loop = partial(on, model=model, predicted=predicted)
        yield Panel(f"{curve.id} {model}", draw_loop, *labels, data, title)
