"""Bars of the normalised errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from mapmore_cli.domain.scores import REPEATABILITY
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel, Values
from mapmore_cli.reporting.figures.panels import key, label_rows, titles, write_beside
from mapmore_cli.reporting.figures.style import BLACK, GREY, ModelStyle, model_styles
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


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One figure for all models: their pooled scores in per cent, and published ones."""
    pooled = [s for s in inputs.validation.scores if s.curve == "all"]
    found = {(s.model, s.split): 100 * s.nrmse for s in pooled if math.isfinite(s.nrmse)}
    present = {split for model, split in found if model != REPEATABILITY}
    bars = {
        split: {model: found.get((model, split), math.nan) for model in inputs.models}
        for split in SPLITS
        if split in present
    }
    if not bars:
        return []
    paper, solid = inputs.published, next(iter(bars))
    published = {}
    if paper is not None and solid == "validate":  # published numbers are of such data alone
        published = {m: 100 * paper.nrmse[m] for m in inputs.models if m in paper.nrmse}
    floor = found.get((REPEATABILITY, solid), math.nan)
    styles = model_styles([*inputs.lines, *inputs.models], inputs.style.palette)
    handles: list[Any] = [
        Patch(label=SPLITS[split], **_bar_look(BLACK, split == solid)) for split in bars
    ]
    caption = (
        "Normalised root mean square error of all curves pooled. "
        f"{full_scale(pooled, inputs.target.unit)}"
    )
    if math.isfinite(floor):
        handles.append(key(f"repeatability {floor:.2f}", **FLOOR))
        caption += (
            " The dashed line is what repeated measurements differ by, to be held against the "
            "solid bars."
        )
    if paper is not None and published:
        handles.insert(len(bars), key("published", **DIAMOND))
        caption += f" Diamonds: {paper.source}."
    on = partial(draw_nrmse, bars=bars, published=published, floor=floor, styles=styles)
    panel = Panel("", on, "NRMSE (%)", ("",), _bar_numbers(bars, published))
    grid = Layout(0.3 + 0.42 * len(inputs.models))
    return [Drawing("nrmse", caption, (panel,), grid, handles)]


def draw_nrmse(
    ax: Axes,
    bars: Mapping[str, Mapping[str, float]],
    published: Mapping[str, float],
    floor: float,
    styles: Mapping[str, ModelStyle],
) -> None:
    """Draw a pair of bars a model, solid for held-out and hatched for training data, values at the
    right, published ones as diamonds.

    - `bars`: errors by split, then by model; NaN for a failed model, which has no bar.
    - `floor`: what repeated measurements differ by, a dashed line; NaN where there are none.
    """
    models = list(next(iter(bars.values())))
    first = -(len(bars) - 1) / 2 * BAR
    for j, by_model in enumerate(bars.values()):
        for place, (model, value) in enumerate(by_model.items()):
            text = "failed" if math.isnan(value) else f"{value:.2f}"
            if j == 0 and model in published:
                text += f" (published {published[model]:.3g})"
            write_beside(ax, place + first + j * BAR, text)
            if not math.isnan(value):
                look = _bar_look(styles[model].colour, j == 0)
                ax.barh(place + first + j * BAR, value, BAR * 0.9, linewidth=0.8, **look)
    if math.isfinite(floor):
        ax.axvline(floor, zorder=4, **FLOOR)
    if published:
        rows = [models.index(model) + first for model in published]
        ax.plot([*published.values()], rows, zorder=5, clip_on=False, **DIAMOND)
    label_rows(ax, titles([title_of(model) for model in models], 18))
    ax.set_xlim(left=0)


def _bar_look(colour: str, solid: bool) -> dict[str, Any]:
    face, hatch = (colour, None) if solid else ("white", "////")
    return {"facecolor": face, "edgecolor": colour, "hatch": hatch}


def _bar_numbers(
    bars: Mapping[str, Mapping[str, float]], published: Mapping[str, float]
) -> dict[str, Values]:
    rows = [
        (model, split, by_model[model], published.get(model, "") if split == "validate" else "")
        for model in next(iter(bars.values()))
        for split, by_model in bars.items()
    ]
    headings = ("model", "data", "NRMSE [%]", "published NRMSE [%]")
    return dict(zip(headings, zip(*rows, strict=True), strict=True))
