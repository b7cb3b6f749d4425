"""The standard deviation of each sample: a number, a share, a column, or one for each group."""

import numpy as np
import pytest
from ingest_samples import COLUMNS, csv_text
from reading import refused

FORCE = np.array([-100.0, 200.0, 50.0, 40.0])
TEXT = csv_text(t=np.arange(4), P=80, eps=0, F=FORCE, sd=[1, 2, 3, 4], day=[1, 2, 1, 2])
MORE = {**COLUMNS, "sd": {"column": "sd"}, "day": {"column": "day"}}


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        (4.0, [4, 4, 4, 4]),
        ("2 %", [2, 4, 1, 0.8]),
        ("sd", [1, 2, 3, 4]),
        ({"1": 1.0, "2": 500.0}, [1, 500, 1, 500]),
    ],
)
def test_every_sample_has_its_own(ingest, rule, expected):
    asked = {"groups": {"of": "day"}, "uncertainty": {"force": rule, "pressure": 3.0}}
    (curve,) = ingest({"a.csv": TEXT}, columns=MORE, **asked).curves
    assert curve.columns["force_uncertainty"].tolist() == pytest.approx(expected)


@pytest.mark.parametrize(("least", "others"), [(0.0, 1e3), (0.9, 1e3), (1.1, 1e3), (0.0, 0.0)])
def test_one_far_below_the_others_or_zero_is_refused(ingest, least, others):
    """A thousandth of the median is enough for a sample to count as a million others."""
    text = csv_text(t=np.arange(3), P=80, eps=0, F=[others, others, least])
    if least > 1:
        ingest({"a.csv": text}, uncertainty={"force": "2 %"})
        return
    with refused(
        f"data.uncertainty.force: sample {3 if others else 1} of a (value ",
        "has the uncertainty",
        "sqrt(0.25 + (0.02*force)^2)",
    ):
        ingest({"a.csv": text}, uncertainty={"force": "2 %"})
