"""Bars of the normalised errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from mapmore_cli.domain.scores import REPEATABILITY, Score
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import (
    BLACK,
    GREY,
    ModelStyle,
    key,
    label_rows,
    model_styles,
    two_lines,
    write_beside,
)
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.score_tables import full_scale
from mapmore_cli.reporting.table import title_of

BAR = 0.36
SPLITS = {"validate": "held out", "train": "training"}
DIAMOND: dict[str, Any] = {
    "linestyle": "none",
    "marker": "D",
    "markersize": 4.5,
    "color": BLACK,
    "markerfacecolor": "white",
}
FLOOR: dict[str, Any] = {"color": GREY, "linestyle": (0, (3, 2)), "linewidth": 0.9}


@dataclass(frozen=True)
class NrmseBars:
    """NRMSE in per cent by model and then by split, absent for a failed model; published values by
    model.

    `floor` is what repeated measurements differ by, by split, where they were repeated.
    """

    values: Mapping[str, Mapping[str, float]]
    published: Mapping[str, float]
    floor: Mapping[str, float]

    @property
    def splits(self) -> tuple[str, ...]:
        """The splits that have scores, held-out data first."""
        return tuple(
            split for split in SPLITS if any(split in by_split for by_split in self.values.values())
        )


def nrmse_bars(
    models: Sequence[str], scores: Sequence[Score], published: Mapping[str, float]
) -> NrmseBars:
    """Pooled scores of the models in their order."""
    values = {
        model: {
            s.split: 100 * s.nrmse
            for s in scores
            if s.model == model and s.curve == "all" and math.isfinite(s.nrmse)
        }
        for model in (*models, REPEATABILITY)
    }
    floor = values.pop(REPEATABILITY)
    held_out = any(
        "validate" in by_split for by_split in values.values()
    )  # published numbers are of such data alone
    return NrmseBars(
        values,
        {model: 100 * published[model] for model in models if held_out and model in published},
        floor,
    )


def draw_nrmse(ax: Axes, bars: NrmseBars, styles: Mapping[str, ModelStyle]) -> None:
    """Draw a pair of bars a model, solid for held-out and hatched for training data, values at the
    right, published ones as diamonds.

    A dashed line marks what repeated measurements differ by, of the data that the solid bars are
    about.
    """
    first = -(len(bars.splits) - 1) / 2 * BAR
    for place, (model, by_split) in enumerate(bars.values.items()):
        for j, split in enumerate(bars.splits):
            at, solid = place + first + j * BAR, j == 0
            published = (
                f" (published {bars.published[model]:.3g})"
                if solid and model in bars.published
                else ""
            )
            write_beside(
                ax, at, (f"{by_split[split]:.2f}" if split in by_split else "failed") + published, 5
            )
            if split in by_split:
                look = _bar_look(styles[model].colour, solid)
                ax.barh(at, by_split[split], BAR * 0.9, linewidth=0.8, **look)
    if bars.splits[0] in bars.floor:
        ax.axvline(bars.floor[bars.splits[0]], zorder=4, **FLOOR)
    places = {model: place for place, model in enumerate(bars.values)}
    if bars.published:
        ax.plot(
            [*bars.published.values()],
            [places[model] + first for model in bars.published],
            zorder=5,
            clip_on=False,
            **DIAMOND,
        )
    label_rows(ax, [two_lines(title_of(model), 18) for model in places], 0.45, 0.55)
    ax.set_xlim(left=0)


def _bar_look(colour: str, solid: bool) -> dict[str, Any]:
    return {
        "facecolor": colour if solid else "white",
        "edgecolor": colour,
        "hatch": None if solid else "////",
    }


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One figure for all models."""
    bars = nrmse_bars(
        inputs.models, inputs.validation.scores, inputs.published.nrmse if inputs.published else {}
    )
    if not bars.splits:
        return []
    styles = model_styles([*inputs.lines, *inputs.models], inputs.style.palette)
    panel = Panel(
        "", lambda axes: draw_nrmse(axes[0], bars, styles), "NRMSE (%)", ("",), _data(bars)
    )
    handles: list[Patch | Line2D] = [
        Patch(label=SPLITS[split], **_bar_look(BLACK, j == 0))
        for j, split in enumerate(bars.splits)
    ]
    if bars.published:
        handles.append(key("published", **DIAMOND))
    shown = bars.splits[0]
    if shown in bars.floor:
        handles.append(key(f"repeatability {bars.floor[shown]:.2f}", **FLOOR))
    source = f" Diamonds: {inputs.published.source}." if inputs.published and bars.published else ""
    floor = (
        " The dashed line is what repeated measurements differ by, to be held against the "
        "solid bars."
        if shown in bars.floor
        else ""
    )
    normaliser = full_scale(
        [s for s in inputs.validation.scores if s.curve == "all"], inputs.target.unit
    )
    caption = f"Normalised root mean square error of all curves pooled. {normaliser}{floor}{source}"
    results = {
        model: f"{by_split[shown]:.2f} %" if shown in by_split else "failed"
        for model, by_split in bars.values.items()
    }
    spoken = ", ".join(f"{title_of(model)} {result}" for model, result in results.items())
    grid = Grid(height=0.3 + 0.42 * len(bars.values))
    return [
        Drawing(
            "nrmse",
            caption,
            f"NRMSE on {SPLITS[shown]} data: {spoken}.",
            (panel,),
            grid,
            tuple(handles),
        )
    ]


def _data(bars: NrmseBars) -> dict[str, Values]:
    rows = [
        (model, split, by_split.get(split, math.nan))
        for model, by_split in bars.values.items()
        for split in bars.splits
    ]
    models, splits, errors = zip(*rows, strict=True)
    published = [
        str(bars.published[model]) if split == "validate" and model in bars.published else ""
        for model, split, _ in rows
    ]
    return {
        "model": models,
        "data": splits,
        "NRMSE [%]": errors,
        **({"published NRMSE [%]": published} if bars.published else {}),
    }
