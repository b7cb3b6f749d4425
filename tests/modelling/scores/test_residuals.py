"""What stands before the scores of a model: alarms, the share that inputs explain, and training
samples far from the fit.
"""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of
from common import dataset_of as dataset_of_columns
from surfaces import QUANTITIES, built, changed, curves, recipe

from mapmore_cli.domain.arrays import extremes
from mapmore_cli.domain.recording import Curve, Dataset, Recording, uncertainty_of
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import OWN
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.frols.offsets import constant_alone
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.validation import metrics, outliers, residuals
from mapmore_cli.modelling.validation.residuals import (
    FEWEST,
    alarms,
    explained_by_inputs,
    residual_tests,
)

CURVES = curves()
MODEL = built(CURVES)


def dataset_of(made, recordings=(), quantities=QUANTITIES):
    return Dataset("force", "pressure", quantities, recordings, tuple(made))


def said_of(made):
    return [predict(MODEL, one.columns) for one in made]


def alarms_of(*rows, made=CURVES):
    return alarms(MODEL, dataset_of(made), said_of(made), rows)


def test_held_out_samples_outside_of_the_training_range_are_counted():
    """The range ends at 350 kPa; half of the samples outside are no alarm, more than half are."""
    *others, last = CURVES[0], CURVES[1], CURVES[3], CURVES[2]

    def beyond(count):
        pressure = np.where(np.arange(120) < count, 500.0, 250.0)
        return alarms_of(made=(*others, changed(last, pressure=pressure)))

    assert alarms_of() == beyond(60) == ()
    assert [one.partition(" lie")[0] for one in beyond(61)] == ["50.8 % of the held-out samples"]
    assert [one.partition(" lie")[0] for one in beyond(120)] == ["100 % of the held-out samples"]


def test_rows_of_the_model_itself_are_judged_over_all_curves():
    y = np.array([1.0, 2.0, 3.0])
    scale = metrics.normaliser("max", extremes(y), "force", "validate")

    def told(values, model=OWN, curve="all"):
        given = dataset_of_columns({"force": y}, held_out=np.ones(3, dtype=bool), output="force")
        said = [Forecast.of(np.array(values))]
        rows = metrics.score_rows(model, "static", said, given, scale)
        return alarms_of(next(row for row in rows if row.curve == curve))

    assert told(y + 0.1) == told([9.0] * 3, model="mean") == told([9.0] * 3, curve="a") == ()
    assert [one.partition("the model is ")[2] for one in told([2.0] * 3)] == [
        "no better than the mean of the measured values"
    ]
    worse, far = told([4.0, 2.0, 6.01])
    assert "R² on the held-out data is -8.03: the model is worse than the mean" in worse
    assert "is 1 times the full scale (max|force| over validate)" in far
    assert len(told([4.0, 2.0, 6.0])) == 1  # just the full scale
    assert ["no finite error" in one for one in told([np.nan, 2.0, 3.0])] == [True]


def test_a_model_that_uses_no_input_is_an_alarm_if_there_is_one():
    """The time, the target and the output are no inputs that could have been selected."""
    constant = replace(MODEL, inputs=(), body=SimpleNamespace(level=None, ranges=()))
    own_past = replace(constant, inputs=(QUANTITIES["force"],))
    found = dataset_of(CURVES[:0])
    without = dataset_of(CURVES[:0], quantities={"force": QUANTITIES["force"], "time": None})
    for model, given, count in (
        (constant, found, 1), (own_past, found, 1), (MODEL, found, 0), (constant, without, 0)
    ):  # fmt: skip
        told = alarms(model, given, (), ())
        assert ["no input was selected" in one for one in told] == [True] * count


def test_pieces_that_add_nothing_to_their_backbone_are_an_alarm():
    """They add nothing up to 1e-9 of the largest prediction, or were removed."""
    backbone = fit_formula("sarosi", CURVES, "force")
    formula, model = literature.of(backbone), built(CURVES, backbone)
    alone = [formula.predict(backbone.parameters, one.columns) for one in CURVES]
    largest = max(np.abs(values).max() for values in alone)

    def ends_of(model, off):
        """The alarms, if the last prediction is off by a share of the largest."""
        *first, last = alone
        moved = last + np.where(np.arange(len(last)) == 119, off * largest, 0.0)
        return [
            one.partition(" sarosi")[2]
            for one in alarms(model, dataset_of(CURVES), [*first, moved], ())
        ]

    nothing = " on every sample, because its segments add nothing"
    assert [ends_of(model, off) for off in (0.0, 9e-10, 3e-9)] == [[nothing], [nothing], []]
    unknown = changed(CURVES[0], strain=np.full(CURVES[0].size, np.nan))  # no value of either
    nan = [np.full(unknown.size, np.nan)]
    assert "add nothing" in alarms(model, dataset_of((unknown,)), nan, ())[0]
    curves_alone = tuple(replace(one, segments=()) for one in model.body.curves)
    removed = replace(model, body=replace(model.body, curves=curves_alone))
    assert ["left-out training data worse" in end for end in ends_of(removed, 0.0)] == [True]
    assert ends_of(built(CURVES), 0.0) == []


def test_the_share_of_an_input_is_its_uncertainty_times_the_slope(monkeypatch):
    """`y = 1 + 10 x` and `(0.5 * 10)^2 / mean e^2`, e what is left."""
    x = np.linspace(0.0, 1.0, 50)
    y = 1 + 10 * x + np.random.default_rng(0).normal(0, 2, 50)
    columns = {"strain": x, "force": y, uncertainty_of("strain"): np.full(50, 0.5)}
    made = (curve_of(columns),)
    names = {**QUANTITIES, uncertainty_of("strain"): QUANTITIES["strain"]}
    asked = {"level": None, "cuts": {}, "dictionary": ("1", "strain"), "max_terms": 2}
    model = built(made, **asked, tolerance=0.0, extrapolation={"strain": ("straight", "straight")})
    (sentence,) = explained_by_inputs(model, dataset_of(made, quantities=names))
    slope, start = np.polyfit(x, y, 1)
    share = (0.5 * slope) ** 2 / np.mean((y - start - slope * x) ** 2)
    found = re.search(r"makes up ([\d.e+]+) %", sentence).group(1)
    assert float(found) == pytest.approx(100 * share, rel=5e-3)
    assert list(explained_by_inputs(model, dataset_of(made))) == []
    monkeypatch.setattr(residuals, "runs_over_time", lambda _model: True)
    assert list(explained_by_inputs(model, dataset_of(made, quantities=names))) == []


def test_far_samples_are_found_in_their_files_the_farthest_first(monkeypatch):
    """Scales are 1.4826 times the median absolute residual of what trains."""
    x = np.arange(40.0)
    noise = np.random.default_rng(1).normal(0, 1, 40)
    off = np.zeros(40)
    off[[0, 25, 30, 39]] = 50.0, -90.0, 70.0, 999.0
    held, origin = x == 39, (x >= 20).astype(int)
    columns = {"pressure": np.full(40, 100.0), "strain": x, "force": noise + off}
    first = replace(CURVES[0], held_out=np.ones(120, dtype=bool))
    curve = Curve("p", 100.0, columns, held, ("r0", "r1"), origin=origin)
    logs = [
        Recording(
            f"r{n}",
            f"r{n}.csv",
            {"strain": x[origin == n], "load": np.zeros(20)},
            20,
            {},
            "",
            first_row,
        )
        for n, first_row in enumerate((2, 0))
    ]
    given = dataset_of((first, curve), logs)
    forecasts = [Forecast.of(first.columns["force"]), Forecast.of(np.zeros(40))]
    fit = recipe().fit
    found = outliers.outliers(given, forecasts, fit)
    assert [(one.file, one.place, one.curve) for one in found] == [
        ("r1.csv", "sample 26", "p"),
        ("r1.csv", "sample 31", "p"),
        ("r0.csv", "row 2", "p"),
    ]
    force = columns["force"]
    assert [one.off for one in found] == [force[25], force[30], force[0]]
    scale = 1.4826 * np.median(np.abs(force[~held]))
    assert [one.scales for one in found] == pytest.approx([one.off / scale for one in found])
    known = outliers.outliers(given, forecasts, replace(fit, loss="huber", scale=2.0))
    assert [one.scales for one in known] == [one.off / 2.0 for one in found]
    limit = replace(fit, loss="huber", scale=abs(force[0]) / outliers.FAR)
    assert len(outliers.outliers(given, forecasts, limit)) == 2  # the third is exactly at the limit
    monkeypatch.setattr(outliers, "MOST", 2)
    assert outliers.outliers(given, forecasts, fit) == found[:2]
    # residuals in units of their uncertainty, one step ahead if the model has memory
    sure = changed(curve, force_uncertainty=np.where(x == 30, 100.0, 1.0))
    given = dataset_of((first, sure), logs)
    ahead = [forecasts[0], replace(forecasts[1], one_step=np.where(x == 25, force, 0.0))]
    (far,) = outliers.outliers(given, ahead, replace(fit, loss="huber", scale=1.5))
    assert (far.off, far.scales) == (force[0], force[0] / 1.5)


def test_residuals_are_tested_from_twenty_samples_on(monkeypatch):
    """By the parts of each input that varies, in the order of one; by lags where there is none."""
    for n in (FEWEST - 1, FEWEST):
        made = [replace(one.at(np.arange(n)), held_out=np.zeros(n, dtype=bool)) for one in CURVES]
        held = replace(made[0], held_out=np.ones(n, dtype=bool))
        given = dataset_of((held, *made[1:]))
        said = [one.columns["force"] + np.sin(np.arange(n)) for one in given.curves]
        tests = residual_tests(MODEL, given, said, "strain")
        names = [one.name for one in tests]
        # the held-out curve alone is judged, and its pressure is one level
        assert names == (["autocorrelation", "strain"] if n == FEWEST else [])
    assert tests[1].values == pytest.approx(np.sin(np.arange(n)).reshape(10, 2).mean(axis=1))
    over_time = residual_tests(MODEL, given, said, None)
    assert [one.x[0] for one in over_time] == [0, -5]
    # of a longer curve than `PART`, at most 9 in the order of the strain
    monkeypatch.setattr(residuals, "MANY", 9)
    monkeypatch.setattr(residuals, "FEWEST", 4)
    for part, lags in ((19, [0, 1]), (20, [*range(6)])):  # a quarter of 7 samples, or of all 20
        monkeypatch.setattr(residuals, "PART", part)
        assert residual_tests(MODEL, given, said, "strain")[0].x.tolist() == lags
    # errors that are all alike tell nothing
    same = [replace(one, columns={**one.columns, "force": np.zeros(n)}) for one in given.curves]
    assert residual_tests(MODEL, dataset_of(same), [np.ones(n)] * 4, "strain") == ()


def test_the_worst_of_several_pieces_tells_what_a_constant_alone_leaves():
    def piece(*terms, left):
        return SimpleNamespace(terms=terms, selection=SimpleNamespace(sse=left, yy=2.0))

    def note(*pieces):
        return constant_alone(SimpleNamespace(backbone=None, pieces=pieces))

    assert "all but 0.25 of" in note(piece("1", left=0.1), piece("1", left=0.5))[0]
    assert note(piece("1", left=0.1), piece("1", "strain", left=0.5)) == []
