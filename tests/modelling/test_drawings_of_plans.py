"""Drawings and tables of `tune` and `plan`: what stands where, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from mapmore_cli.annexes.planning.drawing import drawing_of
from mapmore_cli.annexes.planning.results import Candidate, Picture, Plan, Trial, Tuning, Until
from mapmore_cli.annexes.planning.views import of_plan, of_search, of_tuning
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import Search, Tried
from mapmore_cli.reporting.figures import style
from mapmore_cli.reporting.figures.drawing import compose

FORCE, STRAIN, LOAD = Quantity("force", "N"), Quantity("strain", "1"), Quantity("load", "kg")
PLACES = {"strain": np.array([0.0, 0.1, 0.2]), "load": np.array([1.0, 2.0, 4.0])}
PICTURE = Picture(
    PLACES, np.array([3.0, 5.0, 4.0]), np.array([2.0, 1.0, 2.0]), {"strain": np.array([0.0, 0.2])}
)
CANDIDATES = tuple(
    Candidate({"strain": x, "load": 10 * x}, "point", half_width=width)
    for x, width in ((0.1, 5.0), (0.15, np.nan), (0.05, 4.0), (0.02, 1.0))
)


def marks(ax, colour):
    """Places of the dots of a colour."""
    dots = [line for line in ax.lines if line.get_marker() == "o" and line.get_color() == colour]
    return [[*zip(*line.get_data(), strict=True)] for line in dots]


def axes_of(drawing):
    """The axes of a figure. Its lines are thin, and it is as high as two or three columns of text
    allow.
    """
    assert 1 < drawing.grid.height < 3
    axes = compose(drawing).axes
    lines = [one.get_linewidth() for ax in axes for one in (*ax.lines, *ax.collections)]
    assert np.hstack(lines).max() <= 2
    return axes


def test_half_widths_over_one_quantity():
    drawing = drawing_of(Plan("p", FORCE, {"strain": STRAIN}, 9.0, CANDIDATES, PICTURE))
    (ax,) = axes_of(drawing)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("strain", "half width of force (N)")
    before, after, measured = ax.lines[:3]
    assert [before.get_ydata().tolist(), after.get_ydata().tolist()] == [[3, 5, 4], [2, 1, 2]]
    assert (before.get_color(), after.get_color()) == (style.BLUE, style.ORANGE)
    assert measured.get_xydata().tolist() == [[0, 0], [0.2, 0]]
    assert not measured.get_clip_on()  # whole dots on the axis
    assert ax.get_ylim()[0] == 0
    # the best three, an unknown half width at the bottom
    assert marks(ax, style.VERMILLION) == [[(0.1, 5)], [(0.15, 0)], [(0.05, 4)]]
    assert [text.get_text() for text in ax.texts] == ["1", "2", "3"]
    words = ["now", "forecast after all", "measured", "next"]
    assert [key.label for key in drawing.legend] == words


def test_half_widths_over_two_quantities_are_colours():
    picture = Picture(PLACES, PICTURE.before, PICTURE.after, PLACES)
    plan = Plan("p", FORCE, {"strain": STRAIN, "load": LOAD}, 9.0, CANDIDATES, picture)
    drawing = drawing_of(plan)
    ax, bar = axes_of(drawing)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("strain", "load (kg)")
    assert bar.get_ylabel() == "half width of force (N)"
    (colours,) = ax.collections
    assert colours.get_offsets().tolist() == [[0, 1], [0.1, 2], [0.2, 4]]
    assert colours.get_array().tolist() == [3, 5, 4]
    dots = [(one.at["strain"], one.at["load"]) for one in CANDIDATES]
    assert marks(ax, style.VERMILLION) == [[dot] for dot in dots]
    assert [text.get_text() for text in ax.texts] == ["1", "2", "3", "4"]
    assert [key.label for key in drawing.legend] == ["measured", "next"]


def test_levels_to_measure_have_no_half_width():
    between = (Candidate({"load": 2.0}, "between", gap=3.0),)
    picture = Picture(PLACES, PICTURE.before, PICTURE.after, PLACES)
    drawing = drawing_of(Plan("p", FORCE, {"load": LOAD}, 9.0, between, picture))
    assert axes_of(drawing)[0].get_ylabel() == ""
    assert drawing.caption.startswith("The levels that were measured")
    assert len(drawing.legend) == 2


ONE = Trial({"order": 2, "stop": "bic"}, 3, (0.2,), 0.2, excess=0.3, spread=0.1)
TWO = Trial({"order": 3, "stop": "bic"}, 5, (0.1,), 0.1, excess=0.0, spread=100.0)
OTHER = Trial({"order": 2, "stop": "ebic"}, 4, (0.3,), 0.3, spread=0.0)
FAILED = Trial({"order": 4, "stop": [True]}, failure="too few")
TUNED = Tuning("t", "levels", "range", (ONE, TWO, OTHER, FAILED), TWO, ONE)


def test_every_combination_has_a_row_with_its_mark():
    view = of_tuning(TUNED)
    (table,) = view.tables
    assert table.rows[0] == (2, "bic", 3, *map(pytest.approx, (20, 30, 10)), "simplest")
    assert [row[-1] for row in table.rows] == ["simplest", "best", "", "failed"]
    assert table.rows[3][:3] == (4, "[True]", None)
    assert view.lines == (
        "failed: order=4, stop=[True]: too few",
        "simplest (within one standard error of the best): --set order=2 --set 'stop=\"bic\"'",
    )
    assert of_tuning(replace(TUNED, chosen=TWO)).lines[1].startswith("simplest (the best itself): ")
    assert of_tuning(replace(TUNED, chosen=TWO)).tables[0].rows[1][-1] == "best, simplest"
    assert [*view.document["set"]] == ["order=2", 'stop="bic"']
    assert (view.document["best"], view.document["chosen"]) == (TWO.settings, ONE.settings)
    trial = view.document["trials"][0]
    assert (trial["set"], trial["above_best"], trial["folds"]) == (ONE.settings, 0.3, (0.2,))
    assert [one["failure"] for one in view.document["trials"]] == [None, None, None, "too few"]


def test_the_structure_that_was_found_is_the_best_or_as_good():
    tried = tuple(
        Tried("map", name, {}, 3, (error,), error, error, excess=0.0, spread=0.0)
        for name, error in (("short", 0.2), ("long", 0.1))
    )
    search = Search("s", "y", "levels", "inner levels", 12.0, tried, 1, 1, "why", notes=("n",))
    found = search.found.words
    for chosen, words in ((1, "the best itself"), (0, "as good as the best")):
        view = of_search(replace(search, chosen=chosen), "s.yaml")
        found = replace(search, chosen=chosen).found.words
        assert view.lines == ("n", f"found: {found} ({words})", "spec: s.yaml")
    assert view.document["spec"] == "s.yaml"


@pytest.mark.parametrize(
    ("until", "words"),
    [
        (Until(2.0, 1.5, 0, 1.0), "a half width of 2 N (22 %) is reached: the widest is 1.5 N"),
        (
            Until(2.0, 5.0, None, 3.0),
            "a half width of 2 N (22 %) is probably out of reach: more measurements reduce",
        ),
        (
            Until(2.0, 5.0, 7, 1.0),
            "a half width of 2 N (22 %) probably needs 7 more measurements (the widest is now 5 N)",
        ),
    ],
)
def test_candidates_have_rows_and_the_forecast_a_sentence(until, words):
    plan = Plan("p", FORCE, {"strain": STRAIN}, 9.0, CANDIDATES, PICTURE, until, ("a note",))
    view = of_plan(plan)
    (table,) = view.tables
    assert table.headings[:3] == ("rank", "strain", "what")
    assert table.rows[0][:4] == (1, 0.1, "point", 5)
    assert len(table.rows[0]) == 6
    assert (len(table.rows), table.notes) == (4, ("a note",))
    assert words in view.lines[0]
    assert view.document["units"] == {"force": "N", "strain": "1"}
    assert (view.document["widest"], view.document["next"][2]["strain"]) == (5, 0.05)
    priced = replace(plan, candidates=(replace(CANDIDATES[0], cost=2.5), CANDIDATES[1]), until=None)
    assert [row[-1] for row in of_plan(priced).tables[0].rows] == [2.5, 1]
    assert of_plan(priced).lines == ()
    gap = replace(plan, candidates=(Candidate({"strain": 2.0}, "between", gap=3.0),))
    assert of_plan(gap).tables[0].rows == ((1, 2, "between", 3),)


def test_every_combination_is_a_dot_with_its_error_and_the_chosen_one_has_a_ring():
    drawing = drawing_of(TUNED)
    assert [key.label for key in drawing.legend] == [
        "order 2",
        "order 3",
        "simplest within one standard error",
    ]
    (ax,) = axes_of(drawing)
    assert ax.lines[0].get_ydata() == pytest.approx([10, 10])
    dots = [mark for line in ax.lines[1:] for mark in line.get_xydata().tolist()]
    assert sorted(dots) == [[3, 20], [3, 20], [4, 30], [5, 10]]
    colours = [line.get_color() for line in ax.lines[1:-1]]
    assert colours[0] == colours[2] != colours[1]
    bars = [path.vertices[:, 1] for bar in ax.collections for path in bar.get_paths()]
    # one standard error of the logarithm below the error, and as far above
    for bar, error, spread in zip(bars, (20, 10, 30), (0.1, 0.18, 0.02), strict=True):
        assert bar == pytest.approx([error * np.exp(-spread), error * (2 - np.exp(-spread))])
