"""Intervals from left-out residuals: the formula against SciPy's distributions, what it covers, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from mapmore_cli.domain.errors import DataError, FitError, UsageError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import CurveRange, Formula, LeftOut, Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.intervals import half_width, interval, summary


def left_out(offsets: list[float], noise: float, samples: int = 200, curves: int | None = None) -> LeftOut:
    """Parts of normal residuals about their offsets."""
    rng = np.random.default_rng(0)
    parts = {f"curve {i}": [b + noise * rng.standard_normal(samples)] for i, b in enumerate(offsets)}
    return summary("recordings", curves or len(offsets), parts)


@pytest.mark.parametrize("curves", [3, 4, 7])
def test_normal_residuals_have_the_interval_of_student(curves: int) -> None:
    found = left_out([3.0, -2.0, 1.0, -4.0], 0.5, samples=20_000, curves=curves)
    between = np.mean([9.0, 4.0, 1.0, 16.0])
    expected = stats.t(curves - 1).ppf(0.975) * np.sqrt(between * (1 + 1 / curves) + 0.25)
    assert half_width(found, 0.95) == pytest.approx(expected, rel=0.01)


def test_heavy_tails_have_the_interval_of_their_quantiles() -> None:
    spikes = np.where(np.arange(1000) % 10 == 0, 100.0, 0.1) * np.where(np.arange(1000) % 20 < 10, 1, -1)
    found = summary("levels", 40, {f"{i}": [spikes] for i in range(40)})
    assert half_width(found, 0.95) == pytest.approx(100 * (1 + 1 / 40), rel=1e-9)


@given(st.lists(st.floats(-50, 50), min_size=2, max_size=8), st.floats(0.01, 5), st.floats(0.1, 100))
def test_a_wider_level_is_wider_and_the_unit_does_not_matter(offsets: list[float], noise: float, scale: float) -> None:
    found = left_out(offsets, noise, samples=50)
    widths = [half_width(found, level) for level in (0.5, 0.8, 0.95, 0.99)]
    assert widths == sorted(widths)
    other = replace(found, offset=scale * found.offset, scatter=scale * found.scatter, sizes=scale * found.sizes)
    assert half_width(other, 0.95) == pytest.approx(scale * widths[2], rel=1e-9)


@pytest.mark.parametrize("curves", [4, 7, 20])
def test_curves_with_offsets_of_their_own_are_covered(curves: int) -> None:
    """Over many campaigns, samples of new curves lie within the interval as often as it says, and not nearly always."""
    rng, inside = np.random.default_rng(curves), []
    for _ in range(150):
        offsets = 3 * rng.standard_normal(curves)
        found = summary("recordings", curves, {f"{i}": [b + rng.standard_normal(40)] for i, b in enumerate(offsets)})
        new = 3 * rng.standard_normal() + rng.standard_normal(40)
        inside.append(np.mean(np.abs(new) <= half_width(found, 0.95)))
    assert 0.92 < np.mean(inside) < 0.995


@pytest.mark.parametrize("residuals", [[], [1.0, np.nan], [np.inf]])
def test_a_part_without_a_prediction_is_refused_by_name(residuals: list[float]) -> None:
    with pytest.raises(FitError, match="without b, "):
        summary("recordings", 3, {"a": [np.ones(3)], "b": [np.array(residuals)]})


def line() -> Model:
    """`force = pressure` between 100 and 200 kPa."""
    fit = FormulaFit("linear", {}, {}, "converged", "-", 1, 1.0, 0.0, 2, ())
    ranges = (CurveRange("all", None, {"pressure": (100.0, 200.0)}),)
    return Model("line", Quantity("force", "N"), (Quantity("pressure", "kPa"),), Formula(fit, None, ranges))


def test_there_is_no_interval_outside_of_the_training_range(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapmore_cli.modelling.intervals.predict", lambda _model, columns: columns["pressure"])
    model = replace(line(), left_out=left_out([1.0, -1.0, 2.0], 0.1))
    low, high = interval(model, {"pressure": np.array([99.0, 100.0, 150.0, 201.0, np.nan])}, 0.95)
    assert np.isnan(low[[0, 3, 4]]).all()
    assert np.isnan(high[[0, 3, 4]]).all()
    assert (low + high)[1:3] / 2 == pytest.approx([100.0, 150.0])


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(DataError, match="holds no left-out residuals") as told:
        interval(line(), {"pressure": np.array([150.0])}, 0.95)
    assert "intervals: true" in str(told.value.remedy)
    for level in (0.0, 1.0, 95.0, -0.5, float("nan")):
        with pytest.raises(UsageError, match="no interval"):
            interval(line(), {"pressure": np.array([150.0])}, level)
