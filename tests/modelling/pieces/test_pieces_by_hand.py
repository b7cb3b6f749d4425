"""Curves and the rules by which they are cut and placed, each constant by hand."""

from dataclasses import replace

import numpy as np
import pytest
from common import curve_of

from mapmore_cli.domain.declared import Contradiction
from mapmore_cli.domain.recording import Dataset, Recording, united
from mapmore_cli.modelling.pieces.build import _labels_of_curves
from mapmore_cli.modelling.pieces.placement import placements, span
from mapmore_cli.modelling.pieces.recipe import CutByDirection, Cuts
from mapmore_cli.modelling.pieces.segmentation import (
    cut_points,
    segment_id,
    trained_at,
    training_curves,
)

MIXED = replace(
    curve_of({"x": np.array([5.0, 1.0, 7.0, 2.0, 9.0])}, np.array([0, 0, 0, 1, 0], dtype=bool)),
    recordings=("a", "b", "c"),
    origin=np.array([2, 0, 2, 0, 1]),
    at_rest=np.array([0, 0, 0, 0, 1], dtype=bool),
)


def test_samples_of_each_recording_are_put_together_again():
    assert [rows.tolist() for rows in MIXED.stretches] == [[1, 3], [4], [0, 2]]
    assert [rows.tolist() for rows in MIXED.logs] == [[1, 3], [4], [0, 2]]
    parts = [MIXED.columns["x"][rows] for rows in MIXED.stretches]
    assert MIXED.together(parts).tolist() == MIXED.columns["x"].tolist()
    whole = replace(MIXED, origin=None)
    assert whole.stretches == (slice(None),)
    assert [rows.tolist() for rows in whole.logs] == [[0, 1, 2, 3, 4]]
    assert whole.together([MIXED.columns["x"]]) is MIXED.columns["x"]


def test_rows_of_a_curve_keep_what_belongs_to_them():
    some = MIXED.at(np.array([0, 2, 4]))
    assert (some.recordings, some.origin.tolist()) == (("b", "c"), [1, 1, 0])
    assert some.columns["x"].tolist() == [5, 7, 9]
    assert (some.training.tolist(), some.at_rest.tolist()) == ([1, 1, 0], [0, 0, 1])
    assert MIXED.training.tolist() == [1, 1, 1, 0, 0]
    assert replace(MIXED, at_rest=None).training.tolist() == [1, 1, 1, 0, 1]
    assert MIXED.limits("x") == (1, 7)
    for measured, limits in (((0, 5), (0, 7)), ((2, 8), (1, 8)), ((2, 5), (1, 7))):
        assert replace(MIXED, measured={"x": measured}).limits("x") == limits
    assert united([{"x": (1, 4)}, {"x": (2, 5), "y": (0, 1)}]) == {"x": (1, 5), "y": (0, 1)}


@pytest.mark.parametrize(
    ("name", "source", "shown"),
    [
        *(("a", "a.csv", "a.csv"), ("a", "day/a.csv.gz", "day/a.csv.gz")),
        *(("day-a", "day/a.csv", "day/a.csv"), ("b", "a.xlsx", "a.xlsx (b)")),
        *(("a", "ba.csv", "ba.csv (a)"), ("a.b", "aXb.csv", "aXb.csv (a.b)")),
    ],
)
def test_a_recording_is_called_by_its_file(name, source, shown):
    assert Recording(name, source, {}, 0, {}).name == shown


def test_rows_of_a_recording_have_no_row_in_the_file_and_pieces_know_their_log():
    whole = Recording("a", "a.csv", {"x": np.arange(4.0)}, 4, {}, first_row=2)
    some = whole.at(np.array([1, 3]))
    assert (some.columns["x"].tolist(), some.rows_kept, some.first_row) == ([1, 3], 2, 0)
    assert Recording("a", "a.csv", {}, 0, {}).first_row == 0
    pieces = whole, replace(whole, id="b-1", log="b")
    assert Dataset("x", None, {}, pieces, ()).logs == {"a": "a", "b-1": "b"}


def test_names_of_segments():
    assert segment_id("c", ("strain",), (2,)) == "c/strain:2"
    assert segment_id("c", ("strain", "velocity"), (2, 1)) == "c/strain:2;velocity:1"
    assert segment_id("c", ("direction", "strain"), (1, 3)) == "c;direction=fall/strain:3"
    assert segment_id("c", ("direction",), (2,)) == "c;direction=rise/all"
    assert segment_id("c", (), ()) == "c/all"


def test_which_curves_train():
    held = np.ones(3, dtype=bool)
    x = {"x": np.arange(3.0)}
    low, high, unseen = (
        replace(curve_of(x, mask, str(level)), level=level)
        for level, mask in ((1.0, ~held), (2.0, ~held), (3.0, held))
    )
    assert [one.id for one in training_curves([low, unseen, high], True)] == ["1.0", "2.0"]
    assert training_curves([unseen], False) == (unseen,)
    assert trained_at([low, high], "all") == (low, high)
    for level, place in (("highest", 1), (1.0, 0)):
        *given, _ = found = trained_at([low, high, unseen], level)
        assert given.pop(place) is (low, high)[place]
        assert all(one.at_rest.all() for one in (*given, found[-1]))
    pooled = replace(low, at_rest=np.array([1, 0, 0], dtype=bool)), unseen, low
    (whole,) = training_curves(pooled, False)
    assert (whole.id, whole.level, whole.recordings) == ("all", None, ("1.0", "3.0"))
    assert whole.at_rest.tolist() == [1, *[0] * 8]
    assert whole.held_out.tolist() == [*[0] * 3, *[1] * 3, *[0] * 3]
    assert whole.columns["x"].tolist() == [0, 1, 2] * 3


def points(x, cut, held=None):
    curve = curve_of({"x": np.asarray(x, dtype=float), "y": np.zeros(len(x))}, held)
    return cut_points(curve, curve.training, "x", "y", cut, lambda _curve, rows: float(len(rows)))


def test_boundaries_by_hand():
    x = np.arange(11.0)
    assert points(x, Cuts("even", 2)).tolist() == [0, 5, 10]
    assert points(x, CutByDirection("x", 0.0)).tolist() == [-1, 0, 1]
    assert points(np.ones(4), Cuts("even", 3)).tolist() == [1, 1]
    held = x > 8
    assert points(x, Cuts("even", 2), held).tolist() == [0, 4, 8]
    at = Cuts("breakpoints", at=(0.0, 4.0, 10.0, 12.0))
    assert points(x, at).tolist() == [0, 4, 10]
    fewest = [points(np.arange(21), Cuts("optimal", 2, min_samples=n))[1] for n in (2, 5, None)]
    assert fewest == [1, 4, 9]  # ends included; of equal costs, the first
    kink = np.abs(np.linspace(0, 10, 501) - 4)
    curve = curve_of({"x": np.linspace(0, 10, 501), "y": kink}, np.linspace(0, 10, 501) > 9)
    found = cut_points(curve, curve.training, "x", "y", Cuts("gradient", 2), None)
    assert found == pytest.approx([0, 4, 9], abs=0.1)
    assert Cuts("optimal", 20).segments == 20
    for method, wrong in (
        ("breakpoints", {"at": (1.0, 1.0)}),
        ("breakpoints", {"at": (2.0, 1.0)}),
        ("optimal", {"count": 21}),
    ):
        with pytest.raises(Contradiction):
            Cuts(method, **wrong)


@pytest.mark.parametrize(
    ("method", "needed", "others"),
    [
        ("even", "count", {"min_samples"}),
        ("breakpoints", "at", {"min_samples"}),
        ("gradient", "count", set()),
        ("optimal", "count", {"min_samples"}),
    ],
)
def test_each_method_needs_a_key_and_refuses_those_that_it_does_not_use(method, needed, others):
    values = {"count": 2, "at": (1.0,), "min_samples": 3}
    with pytest.raises(Contradiction, match=f"method `{method}` needs `{needed}`"):
        Cuts(method)
    own = {needed: values.pop(needed)}
    assert getattr(Cuts(method, **own), needed) == own[needed]
    for key, value in values.items():
        if key in others:
            assert getattr(Cuts(method, **own, **{key: value}), key) == value
            continue
        with pytest.raises(Contradiction, match=f"method `{method}` does not use `{key}`"):
            Cuts(method, **own, **{key: value})


def test_residuals_go_together_within_a_pooled_curve_or_within_a_recording():
    rows = np.array([0, 2, 4])
    one = curve_of({"x": np.zeros(2)})
    pooled = _labels_of_curves(rows, [one, one, one], curve_of({"x": np.zeros(6)}), True)
    assert pooled.tolist() == [0, 1, 2]
    assert _labels_of_curves(rows, [MIXED], MIXED, False).tolist() == [2, 2, 1]
    assert _labels_of_curves(rows, [MIXED], replace(MIXED, origin=None), False) is None
    of_two = replace(MIXED, recordings=("a", "b"))
    assert _labels_of_curves(rows, [of_two], of_two, False).tolist() == [2, 2, 1]
    single = replace(MIXED, recordings=("a",))
    assert _labels_of_curves(rows, [single], single, False) is None


def test_long_curves_are_thinned_for_the_costs_of_intervals():
    for n, thinned in ((500, 500), (501, 251), (1001, 334)):
        curve = curve_of({"x": np.arange(float(n)), "y": np.zeros(n)})
        most = []
        cut = Cuts("optimal", 2)
        cut_points(
            curve,
            curve.training,
            "x",
            "y",
            cut,
            lambda _, rows, most=most: most.append(len(rows)) or 1.0,
        )
        assert max(most) == thinned


@pytest.mark.parametrize(("count", "corners"), [(0, 1), (1, 2), (2, 4), (3, 8), (4, 2), (5, 2)])
def test_corners_of_the_unit_square(count, corners):
    x = np.linspace(2.0, 6.0, 40)
    names = [f"x{place}" for place in range(count)]
    made = placements("unit_square", [x] * count, 3 * x, names)
    assert len({one.slope.tobytes() + one.intercept.tobytes() for one in made}) == corners
    assert len(made) == corners
    for one in made:
        assert one.slope.tolist() == [0.25] * count
        assert {*one.intercept.tolist()} <= {-0.5, -1.5}
        assert one.y_slope == 12


def test_sizes_by_which_data_are_divided():
    (made,) = placements("max_abs", [np.array([-4.0, 2.0])], np.array([1.0, -5.0]), ["x"])
    assert (made.slope, made.intercept, made.y_slope, made.y_intercept) == (0.25, 0, 5, 0)
    (made,) = placements("none", [np.array([-4.0, 2.0])], np.array([1.0, -5.0]), ["x"])
    assert (made.slope, made.intercept, made.y_slope, made.y_intercept) == (1, 0, 1, 0)
    two = [np.array([-4.0, 2.0]), np.array([3.0, 1.0])]
    (made,) = placements("max_abs", two, np.array([1.0, -5.0]), ["x", "z"])
    assert (made.slope.tolist(), made.y_slope) == ([0.25, 1 / 3], 5)
    with pytest.raises(ValueError, match="unknown scaling rule"):
        placements("other", [np.ones(2)], np.ones(2), ["x"])
    assert span([0.0, 2.0]).tolist() == [1, 2]
