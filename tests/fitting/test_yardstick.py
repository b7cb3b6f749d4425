"""Black boxes beside a search, and what a residual depends on."""

from __future__ import annotations

import numpy as np
import pytest

from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.fitting.yardstick import black_boxes, note_of, strongest


def record(y: np.ndarray, **inputs: np.ndarray) -> Dataset:
    columns = {**inputs, "y": y}
    curve = Curve("a", None, columns, np.zeros(len(y), dtype=bool), ("a",))
    return Dataset("y", None, {name: Quantity(name, "1") for name in columns}, (), (curve,))


def test_the_lag_on_which_a_residual_depends_is_named() -> None:
    u = np.random.default_rng(1).normal(size=2000)
    e = np.r_[np.zeros(4), u[:-4] ** 2] + np.random.default_rng(2).normal(size=2000)
    data = record(e, u=u)
    assert strongest(data.curves, [e], ["u"], past=True).startswith("u 4 samples before")
    assert strongest(data.curves, [e], ["u"], past=False) == ""


def test_noise_depends_on_nothing() -> None:
    rng = np.random.default_rng(4)
    data = record(rng.normal(size=300), u=rng.normal(size=300), v=rng.normal(size=300))
    assert strongest(data.curves, [data.curves[0].columns["y"]], ["u", "v"], past=True) == ""


def test_a_black_box_that_errs_clearly_less_is_told_and_no_other() -> None:
    pytest.importorskip("sklearn")
    x = np.linspace(0, 1, 120)
    data = record(np.sin(9 * x), x=x)
    masks = [((np.arange(120) % 5 == fold),) for fold in range(5)]
    errors = black_boxes(data, ["x"], masks, past=False)
    assert errors["gaussian_process"] < 0.01
    told = note_of(errors, 0.05, "x 4 samples before (40% of its variance)")
    assert "a Gaussian process errs" in told
    assert "depends most on x 4 samples before" in told
    assert note_of(errors, 1.1 * min(errors.values()), "") == ""
    assert note_of({}, 1.0, "") == ""
