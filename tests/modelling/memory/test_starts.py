"""How free runs begin: measured, steady and identified first outputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from memory_samples import memory_model, state_set, wandering

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.memory.free_run import free_run

MODEL = memory_model(["y[k-1]", "y[k-2]", "u", "stop(y[k-1], 0.1)"], [1.5, -0.56, 0.03, -0.2], state_set(
    "stop(y[k-1], 0.1)", "u", "y[k-1]", "y[k-2]", ranges={"y[k-1]": (-1.0, 1.0)}), constant=0.01, limits=(-2.0, 2.0))  # fmt: skip


def truth(u):
    return free_run(replace(MODEL, start="steady"), {"u": u}).values


def test_a_steady_start_needs_no_output_and_stays_while_the_input_does():
    values = truth(np.full(50, 0.7))
    assert np.isnan(values[:2]).all()
    assert values[2:] == pytest.approx(np.full(48, (0.03 * 0.7 + 0.01) / 0.06), rel=1e-9)


def test_noise_on_the_first_outputs_is_undone_by_identifying_them():
    u = wandering(600, 3)
    y = truth(u)
    y[:2] = y[2]
    noisy = y + np.random.default_rng(1).normal(0, 0.05, len(y))
    early = slice(2, 30)
    errors = {start: free_run(replace(MODEL, start=start), {"u": u, "y": noisy}).values - y for start in ("measured", "identified")}
    assert np.abs(errors["identified"][early]).max() < 0.5 * np.abs(errors["measured"][early]).max()


def test_without_noise_identified_outputs_are_the_measured_ones():
    u = wandering(300, 5)
    y = truth(u)
    y[:2] = y[2]
    np.testing.assert_allclose(free_run(replace(MODEL, start="identified"), {"u": u, "y": y}).values[2:], y[2:], atol=1e-9)


def test_an_integrator_has_no_steady_output():
    model = replace(memory_model(["y[k-1]", "u"], [1.0, 0.1], state_set("u", "y[k-1]")), start="steady")
    with pytest.raises(DataError, match="no steady output"):
        free_run(model, {"u": np.ones(20)})
