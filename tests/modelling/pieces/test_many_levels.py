"""A choice among many levels looks its side up, and short curves are predicted together: the
numbers are those of one condition and one curve after the other.
"""

import numpy as np
import pytest
from common import curve_of
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import PchipInterpolator
from test_model_evaluation import imagined

from mapmore_cli.modelling.expressions import Name, Number, call
from mapmore_cli.modelling.expressions.syntax import Condition
from mapmore_cli.modelling.forecast import forecast, forecast_each
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.levels import across_levels
from mapmore_cli.modelling.program.statements import Block, Choose, Let, Program
from mapmore_cli.modelling.program.values import COMPARE, INPUT, evaluator
from mapmore_cli.modelling.program.writing import Writer

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


def across(at, levels, values, *how):
    """Constant curves, interpolated at other levels; a curve that is NaN has no value."""
    m = Writer()
    curves = [call("log", Number(-1.0)) if np.isnan(y) else Number(float(y)) for y in values]
    value = across_levels(m, Name(f"{INPUT}level"), levels, *how, curves.__getitem__)
    return evaluator(m.program(["level"], value))({"level": at})[0]


@settings(max_examples=25)
@given(
    st.lists(st.sampled_from([-3.0, -1.0, 0.0, 0.5, 4.0]), min_size=2, max_size=6),
    st.sampled_from(["linear", "pchip"]),
    st.sampled_from([0.0, 0.3, 1.0]),
    st.integers(0, 99),
)
def test_between_levels_the_output_is_that_of_scipy_times_the_share(values, how, share, seed):
    levels = np.cumsum(np.random.default_rng(seed).uniform(0.1, 3, len(values))).tolist()
    pchip = PchipInterpolator(levels, values)
    at = np.linspace(levels[0], levels[-1], 41)
    i = np.clip(np.searchsorted(levels, at, side="right") - 1, 0, len(levels) - 2)
    t = (at - np.take(levels, i)) / np.diff(levels)[i]
    expected = pchip(at) if how == "pchip" else np.interp(at, levels, values)
    expected *= share + (1 - share) * (1 - 2 * t) ** 2
    found = across(at, levels, values, ("zero", "continue_linear"), how, share)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    slopes = pchip(levels, 1) if how == "pchip" else np.gradient(values, levels)
    for end, step in ((0, -2.0), (-1, 2.0)):
        for side, of_end in (("zero", 0), ("continue", 1), ("saturate", 1), ("continue_linear", 1)):
            out = across(np.array([levels[end] + step]), levels, values, (side, side), how, share)
            linear = step * slopes[end] * (side == "continue_linear")
            assert out == pytest.approx(of_end * (values[end] + linear))


@pytest.mark.parametrize("side", ["zero", "continue_linear"])
def test_only_curves_that_count_need_a_value(side):
    """At a level its own curve counts, and between two levels those of both."""
    levels, nan = [1.0, 2.0, 4.0], np.nan
    for number in range(3):
        values = np.where(np.arange(3) == number, 7.0, nan)
        assert across(np.array(levels), levels, values, (side, side), "linear", 1.0)[number] == 7
    at = np.array([1.5, 3.0])
    assert across(at, levels, [1, 2, nan], (side, side), "linear", 1.0)[0] == 1.5
    assert across(at, levels, [nan, 2, 4], (side, side), "linear", 1.0)[1] == 3
    alone = across(np.array([0.0, 1.0, 9.0]), [1.0], [5.0], (side, side), "linear", 1.0)
    assert alone.tolist() == ([0, 5, 0] if side == "zero" else [5, 5, 5])


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
