"""The `report` section: figures, files, and the numbers of a publication."""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from typing import Literal

from mapmore_cli.spec.fields import OfTarget, Quantity, Section, Share

FigureName = Literal["data", "fit", "error", "nrmse", "segments", "terms"]


class Published(Section):
    """Numbers of a publication to show beside ours, by model: `nrmse` as fractions, `rmse` in the target's unit. Never computed with."""

    source: str
    nrmse: dict[str, Share] = {}
    rmse: dict[str, OfTarget] = {}


class Report(Section):
    """Figures and files of the report; `units` are further units, by quantity, to print the equations in, as a publication does."""

    figures: list[FigureName] = ["data", "fit", "error", "nrmse", "segments", "terms"]
    formats: list[Literal["html", "csv", "svg"]] = ["html", "csv", "svg"]
    published: Published | None = None
    units: dict[Quantity, str] = {}
