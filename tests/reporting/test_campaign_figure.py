"""The figure of a campaign: a line of dots for each run."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from campaign_rows import row, rows

from mapmore_cli.domain.scores import REPEATABILITY
from mapmore_cli.reporting.campaign import CampaignScores
from mapmore_cli.reporting.figures.campaign import campaign_figures
from mapmore_cli.reporting.figures.catalogue import rendered
from mapmore_cli.reporting.figures.drawing import compose


def dots(scores):
    """Where the dots of each model stand, by run."""
    (drawing,) = campaign_figures(scores)
    figure = compose(drawing)
    ax = figure.axes[0]
    names = [label.get_text() for label in ax.get_yticklabels()]
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    points = [line for line in ax.lines if line.get_marker() != "None" and line.get_linestyle() == "None"]
    return names, legend, sorted((names[int(y)], float(x)) for line in points for x, y in line.get_xydata())


def test_every_error_is_a_dot_in_the_line_of_its_run() -> None:
    names, legend, found = dots(CampaignScores({"a": rows(mapmore=1, sarosi=4, repeatability=0.5), "b": rows(mapmore=3, sarosi=2)}))
    assert names == ["a", "b"]
    assert legend == ["mapmore", "sarosi", REPEATABILITY]
    assert found == [("a", 0.5), ("a", 1.0), ("a", 4.0), ("b", 2.0), ("b", 3.0)]


@pytest.mark.parametrize("error", [math.nan, math.inf])
def test_a_run_that_diverged_has_no_dot(error: float) -> None:
    scores = CampaignScores({"a": rows(mapmore=1, narx=2), "b": [row("mapmore", 3.0), replace(row("narx", 1.0), nrmse=error)]})
    assert dots(scores)[2] == [("a", 1.0), ("a", 2.0), ("b", 3.0)]


def test_of_many_models_the_best_are_drawn() -> None:
    models = {f"m{number}": 2.0 + number for number in range(12)}
    legend = dots(CampaignScores({"a": rows(mapmore=50, **models), "b": rows(mapmore=60, **models)}))[1]
    assert legend == ["mapmore", *(f"m{number}" for number in range(6))]


def test_there_is_nothing_to_compare_in_one_run() -> None:
    assert campaign_figures(CampaignScores({"a": rows(mapmore=1, sarosi=2)})) == []
    assert campaign_figures(CampaignScores({})) == []


def test_the_same_scores_give_the_same_bytes() -> None:
    rng = np.random.default_rng(0)
    scores = CampaignScores({f"run {n}": rows(mapmore=rng.uniform(1, 9), sarosi=rng.uniform(1, 90)) for n in range(40)})
    first, second = ([rendered(drawing).svg for drawing in campaign_figures(scores)] for _ in range(2))
    assert first == second


def test_where_runs_have_few_models_in_common_the_best_of_the_others_is_drawn() -> None:
    runs = {"a": rows(mapmore=2, sarosi=4, kerscher=3, repeatability=1), "b": rows(mapmore=1, narx=5), "c": rows(mapmore=3, cubic=2)}
    _, legend, found = dots(CampaignScores(runs))
    assert legend == ["mapmore", "best of the others", REPEATABILITY]
    assert found == [("a", 1.0), ("a", 2.0), ("a", 3.0), ("b", 1.0), ("b", 5.0), ("c", 2.0), ("c", 3.0)]


def test_an_error_of_rounding_leaves_room_for_the_others() -> None:
    scores = CampaignScores({"exact": [replace(row("mapmore", 1.0), nrmse=1e-16), row("sarosi", 2.0)], "b": rows(mapmore=3, sarosi=2)})
    assert dots(scores)[2] == [("b", 2.0), ("b", 3.0), ("exact", 2.0)]
    (drawing,) = campaign_figures(scores)
    assert drawing.caption.endswith("its error is but rounding: mapmore in exact.")
