"""Thresholds, and curves that are interpolated between places that correspond."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import built, changed, curves

from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.build import threshold
from mapmore_cli.modelling.pieces.recipe import Cuts

STRAINS = (0.0, 0.05, 0.1, 0.15)


def foot(strain):
    """Threshold pressure of the imagined slack muscle."""
    return 100 + 2000 * strain


def hinged(pressure, strain):
    return (1 - 3 * strain) * np.maximum(pressure - foot(strain), 0.0)


def slack_curves(strains=STRAINS, held_out=(), noise=0.5, seed=0):
    """Isometric curves with a creeping slack foot."""
    rng = np.random.default_rng(seed)
    made = []
    for strain in strains:
        pressure = rng.uniform(50, 600, 500)
        force = hinged(pressure, strain) + rng.normal(0, noise, 500) + 5 * np.sin(pressure / 50) * (pressure < foot(strain))
        columns = {"pressure": pressure, "strain": np.full(500, strain), "force": force}
        made.append(Curve(f"strain={strain:g}", strain, columns, np.full(500, strain in held_out), ()))
    return made


@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize("seed", range(5))
def test_the_corner_of_a_slack_foot_is_found(strain, seed):
    (curve,) = slack_curves([strain], noise=3, seed=seed)
    assert threshold(curve.columns["pressure"], curve.columns["force"]) == pytest.approx(foot(strain), abs=20)


def test_a_curve_that_falls_to_a_foot_has_it_on_the_right():
    x = np.linspace(0, 1, 200)
    assert threshold(x, np.maximum(0.7 - x, 0)) == pytest.approx(0.7, abs=0.02)


@pytest.mark.parametrize(("slope", "end"), [(3.0, 2.0), (-3.0, 5.0)])
def test_without_a_foot_the_threshold_is_the_lower_end(slope, end):
    x = np.linspace(2, 5, 200)
    assert threshold(x, slope * x + 7) == end


def test_a_bend_high_above_the_lower_end_is_no_foot():
    """A free force that drops steeply at first, as with flat tubes, has its threshold at the free strain."""
    x = np.linspace(0, 1, 200)
    assert threshold(x, np.where(x < 0.1, 1 - 6 * x, 0.4 * (1 - x) / 0.9)) == 1.0


def test_a_constant_input_is_its_own_threshold():
    assert threshold(np.full(5, 3.0), np.arange(5.0)) == 3.0


SLACK = {"level": "strain", "dictionary": ("1", "pressure", "pressure^2"), "cuts": {"pressure": Cuts("even", 6)}, "max_terms": 3}


@pytest.mark.parametrize("levels", ["linear", "pchip"])
def test_alignment_carries_the_foot_between_levels(levels):
    pressure = np.linspace(60, 590, 300)
    at = {"pressure": pressure, "strain": np.full(300, 0.1)}
    samples = slack_curves(held_out=(0.1,))
    error = {}
    for align in ("none", "threshold"):
        model = built(samples, **SLACK, levels=levels, align=align)
        error[align] = np.sqrt(np.mean((predict(model, at) - hinged(pressure, 0.1)) ** 2))
    assert error["threshold"] < 0.5 * error["none"]


@cache
def slack_model(levels, align):
    return built(slack_curves(), **SLACK, levels=levels, align=align)


@settings(max_examples=20)
@given(st.sampled_from(["linear", "pchip"]), st.sampled_from(["none", "threshold"]), st.floats(60, 590))
def test_continuous_across_levels(levels, align, pressure):
    model = slack_model(levels, align)
    steps = []
    for n in (1001, 4001):
        at = {"pressure": np.full(n, pressure), "strain": np.linspace(-0.01, 0.16, n)}
        steps.append(np.abs(np.diff(predict(model, at))).max())
    assert steps[1] < 0.4 * steps[0] + 1e-9


def test_constants_pass_whatever_the_interpolation():
    samples = [changed(c, force=np.full(c.size, 7.0)) for c in curves()]
    at = {"pressure": np.linspace(20, 420, 50), "strain": np.full(50, 0.03)}
    for levels in ("linear", "pchip"):
        made = {"dictionary": ("1",), "levels": levels, "extrapolation": {"pressure": ("continue_linear", "continue")}}
        np.testing.assert_allclose(predict(built(samples, **made, align="threshold"), at), 7.0)
