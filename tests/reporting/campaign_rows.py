"""Score rows by hand, for the tests of campaigns."""

from __future__ import annotations

from mapmore_cli.domain.scores import Score


def row(model: str, rmse: float, split: str = "validate") -> Score:
    return Score(model, "static", split, "all", 10, rmse, rmse / 100, 100, "max|force| over validate", rmse, rmse / 100, 0.9)


def rows(**errors: float) -> list[Score]:
    return [row(model, rmse) for model, rmse in errors.items()]
