"""A choice among many levels looks its side up, and short curves are predicted together: the
numbers are those of one condition and one curve after the other.
"""

import numpy as np
import pytest
from common import curve_of
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_model_evaluation import imagined

from mapmore_cli.modelling.expressions import Name, Number
from mapmore_cli.modelling.expressions.syntax import Condition
from mapmore_cli.modelling.forecast import forecast, forecast_each
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.program.statements import Block, Choose, Let, Program
from mapmore_cli.modelling.program.values import COMPARE, evaluator

NUMBERS = st.sampled_from([-1.0, -0.0, 0.0, 0.5, 1.0, 2.0])
CASES = st.lists(st.tuples(st.sampled_from(sorted(COMPARE)), NUMBERS), min_size=16, max_size=24)
PLACES = st.sampled_from([-2.0, -1.0, 0.0, 0.3, 1.0, 2.0, 3.0])


def side(number):
    return Block((Let(f"y_{number}", Name("x_x") * 2.0 + float(number)),), (Name(f"y_{number}"),))


@given(CASES, arrays(float, st.integers(1, 9), elements=PLACES))
def test_a_side_is_that_of_the_first_condition_that_holds(cases, x):
    chosen = tuple(
        (Condition(Name("x_x"), word, Number(number)), side(place))
        for place, (word, number) in enumerate(cases)
    )
    body = Block((Choose(("y",), chosen, side(len(cases))),), (Name("y"),))
    (found,) = evaluator(Program(("x",), (), body, ()))({"x": x})
    places = [
        next((i for i, (word, n) in enumerate(cases) if COMPARE[word](one, n)), len(cases))
        for one in x.tolist()
    ]
    assert found.tolist() == (2 * x + places).tolist()


@pytest.mark.parametrize("most", [3, 1000])
def test_short_curves_are_predicted_together(most, monkeypatch):
    monkeypatch.setattr("mapmore_cli.modelling.forecast.TOGETHER", most)
    rng = np.random.default_rng(4)
    model = imagined(rng, ["a", "b"], "b", 8, {"a": 3})
    curves = [
        curve_of({"a": rng.uniform(-1, 1, n), "b": rng.uniform(0, 5, n)}) for n in (3, 1, 40, 7)
    ]
    apart = [forecast(model, curve).values for curve in curves]
    calls = []

    def counted(model, columns):
        calls.append(len(columns["a"]))
        return predict(model, columns)

    monkeypatch.setattr("mapmore_cli.modelling.forecast.predict", counted)
    together = forecast_each(model, curves, model.output.name)
    assert calls == ([44, 7] if most == 3 else [51])
    for one, values in zip(together, apart, strict=True):
        np.testing.assert_array_equal(one.values, values)
