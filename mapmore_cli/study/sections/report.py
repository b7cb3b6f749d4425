"""Define the section `report`: its figures, formats and style."""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from mapmore_cli.reporting.order import FIGURES
from mapmore_cli.study.fields import Metres, Quantity, Section
from mapmore_cli.study.sections.results import PublishedScores


class Style(Section):
    """Appearance of the figures.

    - `width`: Width of a single panel. Example: `85 mm`
    - `font`: Font of all labels. Example: `Times New Roman`
    - `size` (pt): Font size of the labels; titles and ticks are 1 pt smaller. Example: `9`
    - `labels`: Axis labels by quantity. The unit is part of the label, and formulas may stand
      between dollar signs. Example: `{strain: "Contraction (–)"}`
    - `palette`: Colours of the models; the first is the colour of the run's own model. Example:
      `["#0072B2", "#D55E00"]`
    """

    width: Metres = 0.0889
    font: str | None = None
    size: Annotated[float, Field(ge=5, le=24)] = 8.0
    labels: dict[Quantity, str] = {}
    palette: list[Annotated[str, Field(pattern=r"^#[0-9A-Fa-f]{6}$")]] = []


class Report(Section):
    """Figures and files of the report.

    - `figures`: The figures, in their order on the page. Example: `[data, fit, error]`
    - `formats`: Files to write. `html` is the page with quick drawings of the figures. `csv` and
      `tex` are the tables. `svg` writes a file for each figure, drawn as for print, and shows it on
      the page. `pdf`, `png` and `pgf` write every panel to a file in `panels/`, together with the
      numbers from which it was drawn. Example: `[html, pdf]`
    - `style`: Appearance of the figures. Example: `{width: 85 mm, size: 9}`
    - `published`: Printed numbers of a publication to show beside the scores. Example: `{source: M2
      table 5, nrmse: {sarosi: 0.021}}`
    - `units`: Further units in which the equations are printed, by quantity, for example those of a
      publication. Example: `{pressure: bar}`
    - `over`: Axis of the figure of the fit. With `time`, recordings are drawn over time for every
      model. By default, models with memory, models of motion and step responses (`data.plateau`)
      are drawn over time, and everything else over an input. Example: `time`
    - `explore`: If false, the page does not compute the model in the browser, and is smaller
      because the scripts are left out. Example: `false`
    """

    figures: list[Literal[tuple(FIGURES)]] = list(FIGURES)  # type: ignore[valid-type]
    formats: list[Literal["html", "csv", "tex", "svg", "pdf", "png", "pgf"]] = ["html", "csv"]
    style: Style = Style()
    over: Literal["time"] | None = None
    explore: bool = True
    published: PublishedScores | None = None
    units: dict[Quantity, str] = {}
