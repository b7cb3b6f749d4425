"""Draw the normalised errors of all models as bars."""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING, Any

from mapmore_cli.domain.scores import REPEATABILITY
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import key, label_rows, looks_of, titles, write_beside
from mapmore_cli.reporting.figures.style import BLACK, GREY
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.score_tables import full_scale
from mapmore_cli.reporting.table import title_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    """Return one figure of the pooled scores of all models, in per cent. Each model has a solid bar
    for held-out data and a hatched bar for training data, with the values at the right. Published
    values are diamonds. A model whose fit failed has no bar. A dashed line shows the difference
    between repeated measurements.
    """
    pooled = [s for s in inputs.validation.scores if s.curve == "all"]
    errors = {(s.model, s.split): 100 * s.nrmse for s in pooled if math.isfinite(s.nrmse)}
    splits = [split for split in SPLITS if any((m, split) in errors for m in inputs.models)]
    if not splits:
        return []
    # published numbers are errors on held-out data, so they are not shown beside training errors
    paper = inputs.published if splits[0] == "validate" else None
    known = {} if paper is None else paper.nrmse
    published = {(m, "validate"): 100 * known[m] for m in inputs.models if m in known}
    floor, looks = errors.get((REPEATABILITY, splits[0])), looks_of(inputs)
    bars = product(inputs.models, splits)
    rows = [(*bar, errors.get(bar, math.nan), published.get(bar, "")) for bar in bars]

    def on(ax: Axes) -> None:
        for number, (model, split, error, printed) in enumerate(rows):
            row, place = divmod(number, len(splits))
            at = row + (place - (len(splits) - 1) / 2) * BAR
            text = "failed" if math.isnan(error) else f"{error:.2f}"
            if printed != "":
                ax.plot(printed, at, zorder=5, clip_on=False, **DIAMOND)
                text += f" (published {printed:.3g})"
            if math.isfinite(error):
                look = _bar_look(looks[model].colour, split == splits[0])
                ax.barh(at, error, BAR * 0.9, linewidth=0.8, **look)
            write_beside(ax, at, text)
        if floor is not None:
            ax.axvline(floor, zorder=4, **FLOOR)
        label_rows(ax, titles([title_of(model) for model in inputs.models], 18))
        ax.set_xlim(left=0)

    handles = [key(SPLITS[split], **_bar_look(BLACK, split == splits[0])) for split in splits]
    caption = (
        "Normalised root mean square error of all curves pooled. "
        f"{full_scale(pooled, inputs.target.unit)}"
    )
    if published:
        handles.append(key("published", **DIAMOND))
    if floor is not None:
        handles.append(key(f"repeatability {floor:.2f}", **FLOOR))
        caption += (
            " The dashed line is the difference between repeated measurements; compare it with "
            "the solid bars."
        )
    if paper is not None and published:
        caption += f" Diamonds: {paper.source}."
    headings = ("model", "data", "NRMSE [%]", "published NRMSE [%]")
    data = dict(zip(headings, zip(*rows, strict=True), strict=True))
    panel = Panel("", on, "NRMSE (%)", ("",), data)
    return [Drawing("nrmse", caption, (panel,), Layout(0.3 + 0.42 * len(inputs.models)), handles)]


def _bar_look(colour: str, solid: bool) -> dict[str, Any]:
    face, hatch = (colour, None) if solid else ("white", "////")
    return {"facecolor": face, "edgecolor": colour, "hatch": hatch}
