"""The report of a model with memory: loops, what oscillates, what else would have served, free run
beside one step.
"""

import numpy as np
import pytest
from report_builder import tables_of

from mapmore_cli.domain.fits import SegmentedCurve
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.domain.results import FitResult, Forecast, Validation
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.memory import model as memory
from mapmore_cli.modelling.memory.fitting import fit_with_memory
from mapmore_cli.modelling.memory.records import records_of
from mapmore_cli.modelling.selection import MemoryRecipe
from mapmore_cli.modelling.validation.metrics import divisor, score_rows
from mapmore_cli.modelling.validation.shown import for_report
from mapmore_cli.reporting.figures.drawing import compose, drawings
from mapmore_cli.reporting.figures.style import figure_style
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.score_tables import score_table

STEP = 0.01
QUANTITIES = {
    q.name: q
    for q in (
        Quantity("time", "s"),
        Quantity("load", "N"),
        Quantity("pressure", "kPa"),
        Quantity("motion", "mm"),
    )
}


def report_of(dictionary, *, ridge=0.0, scale=False, free_run=False):
    """A muscle that lags behind its pressure; the later part of the record is held out."""
    n = 590
    time = np.arange(n) * STEP
    pressure = 300 + 200 * np.sin(2 * np.pi * time / 3) + 60 * np.sin(2 * np.pi * time / 0.7)
    motion = np.zeros(n)
    for k in range(1, n):
        motion[k] = 0.9 * motion[k - 1] + 0.004 * pressure[k - 1]
    motion += np.random.default_rng(1).normal(0, 0.01, n)
    columns = {"time": time, "load": np.full(n, 5.0), "pressure": pressure, "motion": motion}
    curve = Curve(
        "a", None, columns, time > time[-1] / 2, ("a",), None, np.zeros(n, dtype=np.int64)
    )
    dataset = Dataset(
        "motion", None, QUANTITIES, (Recording("a", "a.csv", columns, n, {}),), (curve,)
    )
    recipe = MemoryRecipe(
        target="motion",
        dictionary=tuple(dictionary),
        step=STEP,
        ordered=False,
        scaling="range" if scale else "none",
        ridge=ridge,
        max_terms=2,
        tolerance=0.0,
        stop="free_run" if free_run else "tolerance",
        criterion="free_run" if free_run else "one_step",
    )
    fit = fit_with_memory(records_of([curve], STEP), recipe)
    limits = {name: (float(x.min()), float(x.max())) for name, x in columns.items()}
    model = memory.memory_model(
        "demo", fit.model, None, (SegmentedCurve("a", None, limits, (), (), ()),), QUANTITIES
    )
    forecasts = {"mapmore": (forecast(model, curve),), "flat": (Forecast.of(np.full(n, 12.0)),)}
    scores = [
        row
        for name, found in forecasts.items()
        for row in score_rows(name, "motion", found, dataset, divisor(dataset, "range"))
    ]
    predictions = {name: tuple(one.values for one in found) for name, found in forecasts.items()}
    validation = Validation(predictions, {}, tuple(scores), {"motion": "mm"})
    result = FitResult(fit)
    whole = for_report(validation, model, dataset)
    return ReportInputs("demo", {}, dataset, (), result, model, whole, (), None, "", {})


@pytest.fixture(scope="module")
def fed_back():
    return report_of(["motion[k-1]", "pressure[k-1]", "load"])


@pytest.fixture(scope="module")
def driven():
    return report_of(
        ["pressure", "slow(pressure, 0.1)", "play(pressure, 0.2)", "resonance(pressure)"],
        ridge=1e-3,
        scale=True,
    )


def test_loops_are_drawn_in_the_order_of_time_over_what_drives_them(fed_back):
    found = {drawing.name: drawing for drawing in drawings("fit", fed_back)}
    assert list(found) == ["loops", "fit"]
    with figure_style():
        panel = compose(found["loops"]).axes[0]
    assert panel.get_xlabel() == "Pressure (kPa)"  # not the load, which never varies
    measured, own = panel.lines
    assert (np.diff(measured.get_xdata()) < 0).any()
    curve = fed_back.dataset.curves[0]
    assert measured.get_xdata()[0] == curve.columns["pressure"][curve.held_out][0]
    np.testing.assert_allclose(own.get_ydata(), measured.get_ydata(), atol=0.1)
    assert "grey where samples are used for training" in found["fit"].caption


def test_free_run_stands_beside_one_step_where_they_differ(fed_back, driven):
    scores = fed_back.validation.scores
    shown = score_table(scores, {"motion": "mm"})
    assert [column.name for column in shown.columns[-2:]] == ["RRSE, free run", "RRSE, one step"]
    own, flat = shown.rows[:2]
    assert 0 < own[-2] != own[-1] > 0
    assert own[-2] == pytest.approx(np.sqrt(1 - own[-3]))
    assert np.isnan(flat[-1])
    assert not any(
        "RRSE" in column.name
        for column in score_table(driven.validation.scores, {"motion": "mm"}).columns
    )


def test_the_error_of_every_number_of_terms_is_told():
    inputs = report_of(["motion[k-1]", "pressure[k-1]", "1"], free_run=True)
    fit = inputs.fit.memory
    assert tables_of(inputs)["sizes"].rows == tuple(enumerate(fit.held_out.tolist(), 1))
    assert len(fit.held_out) == 2
    assert len(fit.model.terms) == int(np.argmin(fit.held_out)) + 1
    assert tables_of(report_of(["pressure"]))["sizes"].rows == ()
