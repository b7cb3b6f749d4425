"""Intervals from left-out residuals: the formula against SciPy's distributions, what it covers, and
what is refused.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mapmore_cli.domain.errors import DataError, FitError, UsageError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.domain.recording import CurveRange, Quantity
from mapmore_cli.modelling.validation.intervals import (
    between_levels,
    half_widths,
    interval,
    interval_limits,
    left_out_summary,
    many_curves,
    scatter_of_recordings,
    with_levels,
)
from mapmore_cli.modelling.validation.offsets import offsets_of


def left_out(offsets, noise, samples=200, curves=None):
    """Parts of normal residuals about their offsets."""
    rng = np.random.default_rng(0)
    parts = {
        f"curve {i}": [b + noise * rng.standard_normal(samples)] for i, b in enumerate(offsets)
    }
    return left_out_summary("recordings", curves or len(offsets), parts)


@pytest.mark.parametrize(("curves", "level"), [(3, 0.95), (4, 0.8), (7, 0.99)])
def test_normal_residuals_have_the_interval_of_student(curves, level):
    found = left_out([3.0, -2.0, 1.0, -4.0], 0.5, samples=20_000, curves=curves)
    between = np.mean([9.0, 4.0, 1.0, 16.0])
    quantile = stats.t(curves - 1).ppf(0.5 + level / 2)
    expected = quantile * np.sqrt(between * (1 + 1 / curves) + 0.25)
    assert many_curves(found, level) == pytest.approx(expected, rel=0.01)


def test_heavy_tails_have_the_interval_of_their_quantiles():
    spikes = np.where(np.arange(1000) % 10 == 0, 100.0, 0.1) * np.where(
        np.arange(1000) % 20 < 10, 1, -1
    )
    found = left_out_summary("levels", 40, {f"{i}": [spikes] for i in range(40)})
    assert many_curves(found, 0.95) == pytest.approx(100 * (1 + 1 / 40), rel=1e-9)


def test_a_summary_has_the_numbers_of_each_part():
    parts = {"a": [np.array([1.0, 3.0]), np.array([5.0])], "b": [np.array([-2.0, -2.0])]}
    found = left_out_summary("recordings", 7, parts)
    assert (found.kind, found.curves, found.parts) == ("recordings", 7, ("a", "b"))
    assert (found.samples.tolist(), found.offset.tolist()) == ([3, 2], [3, -2])
    assert found.scatter.tolist() == [pytest.approx(np.sqrt(8 / 3)), 0]
    assert found.sizes[0, [0, 50, 100]].tolist() == [1, 3, 5]
    assert found.sizes[1].tolist() == [2] * 101


@pytest.mark.parametrize("residuals", [[], [1.0, np.nan], [np.inf]])
def test_a_part_without_a_prediction_is_refused_by_name(residuals):
    with pytest.raises(FitError, match="fitted without b cannot predict it"):
        left_out_summary("recordings", 3, {"a": [np.ones(3)], "b": [np.array(residuals)]})


def line():
    """`force = pressure` between 100 and 200 kPa."""
    fit = FormulaFit("linear", {}, {}, "converged", "-", 1, 1.0, 0.0, 2, ())
    ranges = (CurveRange("all", None, {"pressure": (100.0, 200.0)}),)
    return Model(
        "line", Quantity("force", "N"), (Quantity("pressure", "kPa"),), Formula(fit, None, ranges)
    )


def test_there_is_no_interval_outside_of_the_training_range(
    monkeypatch,
):
    monkeypatch.setattr(
        "mapmore_cli.modelling.validation.intervals.predict",
        lambda _model, columns: columns["pressure"],
    )
    model = replace(line(), left_out=left_out([1.0, -1.0, 2.0], 0.1))
    low, high = interval(model, {"pressure": np.array([99.0, 100.0, 150.0, 201.0, np.nan])}, 0.95)
    assert np.isnan(low[[0, 3, 4]]).all()
    assert np.isnan(high[[0, 3, 4]]).all()
    assert (low + high)[1:3] / 2 == pytest.approx([100.0, 150.0])


def test_what_cannot_be_is_refused():
    with pytest.raises(DataError, match="has no errors on left-out data") as told:
        interval(line(), {"pressure": np.array([150.0])}, 0.95)
    assert "intervals: true" in str(told.value.remedy)
    for level in (0.0, 1.0, 95.0, -0.5, float("nan")):
        with pytest.raises(UsageError, match="is not possible"):
            interval(line(), {"pressure": np.array([150.0])}, level)


def few(count, offset=2.0, repeats=1, astray=0.0, apart=np.nan):
    """`count` levels at 0, 100, ... with an error of `offset` at every inner one."""
    parts = {f"{i}": [np.full(20, offset)] for i in range(1, count - 1)}
    return replace(
        left_out_summary("levels", count, parts),
        places=tuple(100.0 * np.arange(count)),
        repeats=(repeats,) * count,
        largest=400.0,
        residual=0.5,
        astray=astray,
        apart=apart,
    )


@pytest.mark.parametrize(("count", "scale"), [(3, 5.06), (4, 4.03), (5, 3.23), (6, 3.23)])
@pytest.mark.parametrize(
    ("at", "level", "residual"),
    [
        (50.0, 0.95, 0.5),
        (290.0, 0.8, 1e-9),
        (101.0, 0.95, 1e-9),
        (100.0, 0.95, 3.0),
        (-50.0, 0.95, 0.5),
    ],
)
def test_the_rule_for_few_levels_is_written_out(at, level, residual, count, scale):
    """Levels at 0, 100, 400 and more; those left out have an error of 2 and a scatter of 1.5."""
    parts = {"1": [np.array([0.5, 3.5])]}
    made = replace(
        left_out_summary("levels", count, parts),
        places=(0.0, 100.0, 400.0, 500.0, 600.0, 800.0)[:count],
        repeats=(1,) * count, largest=40.0, residual=residual,
    )  # fmt: skip
    low, width = (0.0, 100.0) if at < 100 else (100.0, 300.0)
    t = min(max((at - low) / width, 0.0), 1.0)
    small = max(residual, 1e-3 * 40.0)
    gap = width / made.places[-1] * (count - 1)
    half = scale * np.cbrt(2.5 * small**2) * gap**0.75
    half *= max(4 * t * (1 - t), 0.05) ** 0.6
    normal = stats.norm.ppf(0.5 + level / 2)
    expected = max(half, 1.959964 * residual) * normal / 1.959964
    assert between_levels(made, np.array([at]), level) == pytest.approx([expected], rel=1e-6)


def student(noise, curves, freedom):
    """`t_g^2 V` of both variances together, with `g = f V / V_curves`."""
    both = noise + curves
    return both * stats.t(freedom * both / curves).ppf(0.975) ** 2


def test_a_level_with_repeats_has_the_interval_of_the_repeats():
    """Recordings are .3 apart: `.3^2 (1 + 1/n)` beside the noise, which they are no part of."""
    half = half_widths(few(4, repeats=3, apart=0.3), np.array([100.0, 150.0]), 0.95)
    assert half[0] ** 2 == pytest.approx(student(0.25 - 0.09 * 2 / 3, 0.09 * 4 / 3, 8))
    assert half[1] == between_levels(few(4), np.array([150.0]), 0.95)[0]
    alike = half_widths(few(4, repeats=3, apart=0.0), np.array([100.0]), 0.95)
    assert alike == pytest.approx([0.5 * stats.norm.ppf(0.975)], rel=1e-4)


def test_errors_that_chance_makes_in_a_fifth_of_all_cases_are_not_the_models():
    """One left-out level of three with two recordings each: F of 1 and 3 degrees of freedom, at
    .8, is 2.68; the model's own errors then widen the middle of a gap, not the levels.
    """
    explained = 0.25 - 0.09 / 2 + 0.09 * 1.25
    for share, wider in ((2.6, False), (2.8, True)):
        kept = few(3, offset=np.sqrt(share * explained), repeats=2, apart=0.3)
        half = half_widths(replace(kept, places=(0.0, 100.0, 200.0)), np.array([50.0]), 0.95)
        alone = student(0.25 - 0.09 / 2, 0.09 * 1.25, 3)
        assert bool(half[0] ** 2 > 1.01 * alone) == wider


@pytest.mark.parametrize(("count", "freedom"), [(5, 2.4), (8, 4.2)])
def test_left_out_levels_tell_what_repeats_do_not(count, freedom):
    """Their squared errors are 1.5 of the offsets', beside the noise; a new curve at a level has
    twice those, and what neighbouring samples share has the same quantile.
    """
    half = half_widths(replace(few(count), smooth=0.3), np.array([100.0]), 0.95)
    of_curves = stats.t(freedom).ppf(0.975) ** 2 * ((4 - 0.25) / 1.5 * 2 + 0.09)
    assert half[0] ** 2 == pytest.approx(stats.norm.ppf(0.975) ** 2 * 0.16 + of_curves)


def test_repeats_decide_if_they_have_as_many_degrees_of_freedom_as_left_out_levels():
    """Of six levels, these are three."""
    for repeats, repeated in (((2, 2, 2, 1, 1, 1), True), ((2, 2, 1, 1, 1, 1), False)):
        assert offsets_of(replace(few(6, apart=0.3), repeats=repeats)).repeated is repeated


def test_a_model_without_any_error_has_an_interval_of_no_width():
    perfect = replace(few(4, offset=0.0), residual=0.0)
    assert half_widths(perfect, np.array([100.0, 150.0]), 0.95).tolist() == [0, 0]


def test_samples_without_a_level_or_beyond_the_levels_have_the_width_of_a_gap_or_an_end():
    at = np.array([np.nan, 250.0, 350.0, 300.0])
    unknown, middle, beyond, last = half_widths(few(4, repeats=3, apart=0.3), at, 0.95)
    assert unknown == middle > beyond == last


@pytest.mark.parametrize("count", [7, 9])
@pytest.mark.parametrize("error", [0.1, 0.58, 4.0])
def test_many_levels_with_repeats(count, error):
    """Uneven levels of one to three recordings, sample by sample: noise, what curves differ by, and
    between levels what left-out ones are missed by beyond these; no less than their quantile.
    """
    rng = np.random.default_rng(count)
    n = rng.integers(1, 4, count)
    places = np.cumsum(rng.uniform(1, 3, count))
    found = replace(
        few(count, error),
        places=tuple(places),
        repeats=tuple(n),
        apart=0.3,
        smooth=0.35,
        scatter=np.full(count - 2, 0.2),
    )
    own, f = 0.09, np.sum(n - 1)
    noise, smooth = 0.25 - own * np.mean(1 - 1 / n), 0.35**2 - own * np.mean(1 - 1 / n)
    shares = []
    for i in range(1, count - 1):
        t = (places[i] - places[i - 1]) / (places[i + 1] - places[i - 1])
        shares.append(1 + (1 - t) ** 2 / n[i - 1] + t**2 / n[i + 1])
    explained, missed = noise + own * np.mean(shares), error**2 + 0.04
    model = stats.t(0.6 * (count - 1)).ppf(0.975) ** 2
    clear = max(1.25, stats.f(count - 2, f).ppf(0.8))
    assert f >= 0.6 * (count - 1)
    quantile = 50.0 if error == 0.1 else error
    found = replace(found, sizes=found.sizes * quantile / error)
    assert error != 0.58 or 1 < missed / explained < clear  # within what noise and curves explain
    for gap in range(count - 1):
        for t in (0.0, 0.019, 0.021, 0.4, 0.979, 0.981):
            at = places[gap] + t * (places[gap + 1] - places[gap])
            c = 1 + (1 - t) ** 2 / n[gap] + t**2 / n[gap + 1]
            squares = student(noise - smooth, (own + smooth) * c, f)
            between = 0.02 < t < 0.98
            squares += model * (missed - explained) * (between and missed > clear * explained)
            expected = max(np.sqrt(squares), quantile * between)
            assert half_widths(found, np.array([at]), 0.95) == pytest.approx([expected])


def test_what_neighbouring_residuals_share():
    """The root of their mean product within recordings; zero where they alternate."""
    e, d = np.tile([3.0, 1.0], 2000), np.full(4000, -4.0)
    made = with_levels(few(4), {0.0: [e], 1.0: [d]}, 0)
    assert made.smooth == pytest.approx(np.sqrt((3 + 16) / 2), rel=1e-3)
    assert made.residual == pytest.approx(np.sqrt((5 + 16) / 2))
    assert with_levels(few(4), {0.0: [np.array([1.0, -1.0, 1.0])]}, 0).smooth == 0.0
    two = with_levels(few(4), {0.0: [np.array([2.0, 3.0])], 1.0: [np.array([5.0])]}, 0)
    assert two.smooth == pytest.approx(np.sqrt(6.0))  # one product: its mean is itself


def test_levels_and_repeats_are_known_of_levels_and_blocks_alone():
    e = np.array([1.0, -1.0, 2.0])
    bare, repeated = replace(few(4), places=(), repeats=()), {5.0: [e, 2 * e], 2.0: [e]}
    for kind in ("levels", "blocks"):
        found = with_levels(replace(bare, kind=kind), repeated, 0)
        assert (found.places, found.repeats) == ((2.0, 5.0), (1, 2))
    for kind, training in (("recordings", repeated), ("blocks", {None: [e]})):
        found = with_levels(replace(bare, kind=kind), training, 0)
        assert (found.places, found.residual > 0) == ((), True)
    # as many parameters as samples leave no error to correct by
    assert with_levels(bare, {1.0: [e]}, 3).residual == pytest.approx(np.sqrt(2))
    assert with_levels(bare, {1.0: [e]}, 2).residual == pytest.approx(np.sqrt(2 * 5))


def test_recordings_of_fewer_samples_than_stretches_are_taken_as_their_means():
    first, second = np.array([1.0, 2.0, 4.5]), np.array([0.0, 1.0, -1.0, 0.0, 5.0])
    noise = (first.var() / 3 + second.var() / 5) / 2
    expected = np.sqrt((first.mean() - second.mean()) ** 2 / 2 - noise)
    assert scatter_of_recordings([[first, second], [first]]) == pytest.approx(expected)


def test_repeats_may_differ_by_slopes_of_their_own():
    """By the means of four parts: 1 3 5 7 and 0 0 0 0, each of two samples that scatter by 1."""
    rising, level = np.arange(8.0) + 0.5, np.tile([1.0, -1.0], 4)
    noise = (0.25 / 2 + 1 / 2) / 2
    square = np.sum(np.array([1, 3, 5, 7]) ** 2) / 2 / 4
    found = scatter_of_recordings([[rising, level], [level, level]])
    assert found == pytest.approx(np.sqrt(square / 2 - (noise + 0.5) / 2))
    assert np.isnan(scatter_of_recordings([[rising], [level]]))
    four = [np.array([1.0, 3.0, 5.0, 7.0]), np.zeros(4)]  # one sample in each part has no scatter
    assert scatter_of_recordings([four]) == pytest.approx(np.sqrt(square))


@pytest.mark.parametrize(
    ("count", "repeats", "words"),
    [
        (1, 1, "at least twice"),
        (2, 1, "at least twice"),
        (3, 1, "four or more levels"),
        (2, 2, "a third"),
    ],
)
def test_what_cannot_be_told_has_no_interval_and_a_sentence(count, repeats, words):
    """Repeats of two levels tell it at these, and not between them."""
    found = few(count, repeats=repeats, apart=np.nan if repeats == 1 else 0.3)
    half = half_widths(found, np.array([0.0, 1.9, 2.0, 50.0]), 0.95)  # 2 % of the gap is off it
    assert np.isnan(half).tolist() == [repeats == 1] * 2 + [True] * 2
    assert words in (interval_limits(found) or "")


def test_blocks_of_one_recording_say_nothing_of_another():
    found = replace(left_out([1.0, -1.0, 2.0], 0.1), kind="blocks")
    assert half_widths(found, np.array([np.nan]), 0.95) == pytest.approx([many_curves(found, 0.95)])
    assert "Make three or more" in (interval_limits(found) or "")


def test_a_model_that_goes_astray_without_a_level_has_no_interval():
    found = few(4, astray=0.6)
    assert "60 % of their range" in (interval_limits(found) or "")
    assert np.isnan(half_widths(found, np.array([50.0]), 0.95)).all()
    assert interval_limits(few(4, astray=0.25)) is None
    assert np.isfinite(half_widths(few(4, astray=0.25), np.array([50.0]), 0.95)).all()
    assert interval_limits(few(4, astray=0.26)) is not None
