"""Which samples, curves and words a panel has, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from mapmore_cli.reporting.figures import panels


def test_dots_are_evenly_spread_with_the_extremes_among_them():
    assert panels.evenly(10, 4) == [0, 3, 6, 9]
    assert panels.evenly(3, 4) == [0, 1, 2]
    y = np.array([np.nan, 0, 0, -9.0, 0, 0, 0, 0, 8, 0, np.inf])
    assert panels.cloud(y, 9).tolist() == [*range(1, 10)]
    assert panels.cloud(y, 8).tolist() == [1, 3, 4, 6, 7, 8, 9]
    assert panels.cloud(y, 4).tolist() == [1, 3, 8, 9]


def test_long_lines_are_means_and_ranges_of_equal_stretches():
    x = np.linspace(10, 160, 601)  # four samples in each of 150 stretches
    y = np.where(np.arange(601) % 2, 1.0, -2.0)
    middle, mean, low, high = panels.band(x, y)
    assert len(middle) == 150
    assert middle[:2] == pytest.approx([10.375, 11.375])
    assert middle[-1] == pytest.approx(159.5)
    assert mean[:-1] == pytest.approx(-0.5)
    assert (low == -2).all()
    assert (high == 1).all()
    gap = np.where((x < 20) | (x > 30), y, np.nan)
    assert len(panels.band(x, gap)[0]) == 150 - 10
    assert panels.band(x, np.where(x < 11, np.nan, y))[0][0] == pytest.approx(11.375)
    far = panels.band(np.append(x, 310), np.append(y, 0.0))[0]
    assert (far[0], far[-1]) == pytest.approx((10.875, 310))


@pytest.mark.parametrize(("samples", "filled"), [(600, 0), (601, 1)])
def test_a_line_has_a_band_with_more_than_four_samples_in_each_stretch(samples, filled):
    drawn = []
    ax = SimpleNamespace(
        fill_between=lambda x, *_ends, **_look: drawn.append(len(x)),
        plot=lambda x, _y, **_look: drawn.append(len(x)),
    )
    x = np.linspace(0, 1, samples)
    panels.draw_band(ax, x, x, color="red")
    assert drawn == [150] * filled + [150 if filled else samples]


def test_captions_say_what_is_left_out():
    assert panels.thinned([3, 200]) == ""
    assert panels.thinned([201, 3]) == panels.SOME_DOTS
    assert panels.thinned([600]) == panels.SOME_DOTS
    assert "pale bands" in panels.thinned([601])
    assert (panels.some_of(3, 3, "x"), panels.best_of(3, 3)) == ("", "")
    assert panels.some_of(2, 3, "curves") == " 2 of 3 curves are drawn, evenly spread."
    assert "own and the best other are" in panels.best_of(2, 4)
    assert "own and the best 2 others are" in panels.best_of(3, 4)


def test_curves_that_were_asked_for_are_drawn_otherwise_six_evenly():
    curves = [SimpleNamespace(id=f"c{number}") for number in range(20)]
    inputs = SimpleNamespace(asked=(), dataset=SimpleNamespace(curves=curves))
    ids = [curve.id for curve in curves]
    assert panels.places(inputs, ids[:6]) == [*range(6)]
    assert panels.places(inputs, ids[:11]) == [0, 2, 4, 6, 8, 10]
    assert panels.places(inputs, ids, 2) == [0, 19]
    assert panels.some_curves(inputs, [4, 5, 9], 2) == [4, 9]
    inputs.asked = ("c5", "c9", "c11")
    assert panels.some_curves(inputs, [4, 5, 9], 1) == [5, 9]


@pytest.mark.parametrize(
    ("names", "length", "shown"),
    [
        (["abcdefgh"], 8, ["abcdefgh"]),
        (["abcdefghi"], 8, ["abc…fghi"]),
        (["abcdefghi"], 7, ["abc…ghi"]),
        (["abcdefghi"], 2, ["…i"]),
        (["run_a", "run_b"], 5, ["run_a", "run_b"]),
        (["run_a", "run_b"], 4, ["…a", "…b"]),
        (["long_a_end", "long_bb_end"], 6, ["…a_…", "…bb_…"]),
        (["run aaaaaaaa1aaaa", "run aaaaaaaa2aaaa"], 8, ["1: …a…aa", "2: …a…aa"]),
        (["same_name", "same_name"], 5, ["sa…me", "sa…me"]),
    ],
)
def test_names_are_shortened_so_that_they_stay_different(names, length, shown):
    assert panels.told_apart(names, length) == shown


def test_powers_are_raised_and_names_are_in_lines():
    assert panels.raised("x^2*y^13 + z^1.5 + x^-1") == "x²*y¹³ + z^1.5 + x^-1"
    assert panels.titles(["one two", "three"], 4) == ["one\ntwo", "thre\ne"]
