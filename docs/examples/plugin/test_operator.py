"""Test of the operator: a model must find a state that a loop has computed."""

import numpy as np

import mapmore_cli as mm


def test_a_washout_is_found() -> None:
    """Fit an output that is three times the state, and look at the error and the term."""
    step, tau = 0.01, 0.5  # s
    time = np.arange(0, 20, step)
    voltage = np.sin(time) + 0.3 * np.sin(7 * time)
    state = np.zeros_like(time)
    for k in range(1, len(time)):
        state[k] = np.exp(-step / tau) * (state[k - 1] + voltage[k] - voltage[k - 1])
    model = mm.fit(
        {"time": time, "voltage": voltage, "displacement": 3 * state},
        target={"column": "displacement"},
        split={"validate": {"last": 0.5}},
        dictionary=[{"washout": {"of": ["voltage"], "tau": [0.5, 5]}}],
        fit={"max_terms": 1},
        validate={"simple": False},
    )
    assert model.scores.of_model()["nrmse"] < 1e-6
    assert "washout(voltage, 0.5)" in model.equations[0].text
