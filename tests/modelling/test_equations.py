"""Equations as a person reads them: short, with few digits, and the model within their stated
error.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from surfaces import built, curves

from mapmore_cli.domain.fits import Scaling
from mapmore_cli.modelling.equations import equation, rounded, summed
from mapmore_cli.modelling.expressions import evaluate, parse, to_text
from mapmore_cli.modelling.kinds import equations, predict
from mapmore_cli.modelling.pieces.recipe import Cuts

STATED = 1e-3


def read(text, columns):
    """What a person computes from an equation."""
    whole, *meanings = re.split(r", (?:where )?(?=\w+ = )", text)
    lines = dict(one.split(" = ") for one in meanings)
    return evaluate(
        parse(whole),
        {**columns, **{name: evaluate(parse(line), columns) for name, line in lines.items()}},
    )


def scaling_of(names, low, high, placement, y):
    low, high = np.array(low, float), np.array(high, float)
    anchor = np.where(np.array(placement.split(",")) == "right", high, low)
    return Scaling(
        "unit_square", placement, tuple(names), 1 / (high - low), -anchor / (high - low), *y
    )


def test_scaled_inputs_are_named_once():
    scaling = scaling_of(("length", "pressure"), [10, 0], [840, 620], "right,left", (1.0, 3.0))
    terms = ("pressure", "pressure*exp(-(length + 1)/0.3)", "pressure^2*exp(-(length + 1)/0.03)")
    theta = np.array([490.0, -292.0, -268.0])
    found = equation(
        "all", terms, theta, scaling, {"length": (10.0, 840.0), "pressure": (0.0, 620.0)}, {}
    )
    assert found.text == (
        "3 + 490*p - 292*p*exp(-l/0.3) - 268*p^2*exp(-l/0.03), where l = (length - "
        "10)/830, p = pressure/620"
    )
    assert found.latex.endswith(
        r", \quad l = \frac{\mathrm{length} - 10}{830}, \quad p = \frac{\mathrm{pressure}}{620}"
    )


def test_a_scaled_input_does_not_take_the_name_of_another():
    names = ("p", "pressure", "play(pressure, 0.2)", "pressure[k-3]", "_2", "e_x_p")
    scaling = scaling_of(names, [0] * 6, [2] * 6, ",".join(["left"] * 6), (1.0, 1.0))
    found = equation(
        "a",
        tuple(f"abs({name} - 0.5)" for name in names),
        np.ones(6),
        scaling,
        dict.fromkeys(names, (0.0, 2.0)),
        {},
    )
    assert len({*re.findall(r"(\S+) = ", found.text), *names}) == 12
    columns = {
        name: np.linspace(0, 2, 9) ** (1 + place) / 2**place for place, name in enumerate(names)
    }
    exact = 1 + sum(np.abs(values / 2 - 0.5) for values in columns.values())
    np.testing.assert_allclose(read(found.text, columns), exact, rtol=STATED)


def test_constants_are_added_up():
    scaling = scaling_of(("strain",), [0.0], [0.1], "left", (100.0, 0.925396))
    found = equation(
        "a",
        ("1", "strain", "exp((strain - 1)/0.1)"),
        np.array([-0.4, 2.0, 1.0]),
        scaling,
        {"strain": (0.0, 0.1)},
        {},
    )
    assert found.text == "-39.1 + 200*s + 100*exp((s - 1)/0.1), where s = strain/0.1"


@pytest.mark.parametrize("scaling", ["unit_square", "max_abs", "none"])
@pytest.mark.parametrize("around", [0.0, 0.5, 50.0])
def test_what_is_printed_is_the_model_within_its_stated_error(scaling, around):
    """A quantity that varies by one per cent around a large value needs digits, where it is not
    scaled.
    """
    samples = [
        replace(one, columns={**one.columns, "strain": one.columns["strain"] + around})
        for one in curves(held_out=(), noise=1.0)
    ]
    dictionary = ("1", "strain", "strain^2", "pressure", "pressure*strain", "strain^4")
    model = built(
        samples,
        level=None,
        cuts={"strain": Cuts("even", 1)},
        scaling=scaling,
        max_terms=5,
        tolerance=0.0,
        dictionary=dictionary,
    )
    columns = {
        name: np.concatenate([one.columns[name] for one in samples])
        for name in ("strain", "pressure")
    }
    (found,) = equations(model)
    predicted = predict(model, columns)
    assert np.abs(read(found.text, columns) - predicted).max() <= STATED * np.ptp(predicted)


def test_terms_that_cancel_in_the_samples_keep_enough_digits():
    s = np.linspace(0, 1, 50)
    columns = {"strain": 14 * s, "pressure": 4 * s}  # the strain follows the pressure
    theta = np.array([4772.1245, -58410.1])
    y = theta @ [columns["strain"] ** 2, columns["pressure"] ** 2]
    scaling = Scaling(
        "max_abs", "-", tuple(columns), np.ones(2), np.zeros(2), float(np.abs(y).max()), 0.0
    )
    limits = {name: (0.0, float(x.max())) for name, x in columns.items()}
    terms = ("strain^2", "pressure^2")
    for sign in (1, -1):
        turned = replace(scaling, y_slope=sign * scaling.y_slope)
        found = equation("a", terms, theta / turned.y_slope, turned, limits, {})
        assert np.abs(read(found.text, columns) - y).max() < STATED * np.ptp(y) < 1
        assert len(found.text) < 60  # not more digits than needed


def test_other_units_are_in_the_meanings():
    model = built()
    own, other = equations(model)[1], equations(model, {"strain": 0.01})[1]
    x = np.linspace(*model.body.segments[1].limits["strain"], 20)
    exact = read(own.text, {"strain": x})
    np.testing.assert_allclose(
        read(other.text, {"strain": 100 * x}), exact, atol=2 * STATED * np.ptp(exact)
    )


@pytest.mark.parametrize(
    "term", ["exp(-strain/0.03)", "exp((strain - 1)/0.03)", "pressure*exp((strain - 1)/0.03)"]
)
@pytest.mark.parametrize("placement", ["left,left", "left,right", "right,right"])
def test_no_coefficient_makes_up_for_an_exponential(term, placement):
    """An exponential that was written for the left end, and is placed at the right, is nearly
    constant and tiny or huge.
    """
    names, limits = ("pressure", "strain"), {"pressure": (0.0, 620.0), "strain": (0.01, 0.25)}
    scaling = scaling_of(names, [0, 0.01], [620, 0.25], placement, (1.0, 3.0))
    strain = np.linspace(0.01, 0.25, 100)
    columns = {"strain": strain, "pressure": np.full(100, 620.0) - 300 * (strain > 0.2)}
    z = {
        name: columns[name] * m + c
        for name, m, c in zip(names, scaling.slope, scaling.intercept, strict=True)
    }
    D = evaluate(parse(term), z, 100)
    theta = np.array([40.0, 300 / np.abs(D).max()])
    found = equation("a", ("strain", term), theta, scaling, limits, {})
    assert not re.search(r"e[+-]\d|\d{6}", found.text)
    exact = 3.0 + 40.0 * z["strain"] + theta[1] * D
    assert np.abs(read(found.text, columns) - exact).max() <= STATED * np.ptp(exact) + 1e-9


def test_an_exponential_that_is_zero_for_a_computer_stays_as_it_is():
    scaling = Scaling("none", "-", ("x",), np.ones(1), np.zeros(1), 1.0, 0.0)
    found = equation("a", ("exp((x - 2)/0.001)",), np.array([3.0]), scaling, {"x": (0.0, 1.0)}, {})
    assert found.text == "3*exp((x - 2)/0.001)"


def test_a_long_model_has_an_equation_too():
    """It is longer than an expression that is read may be."""
    names = [f"pressure[k-{lag}]" for lag in range(300)][1:]
    scaling = Scaling("none", "-", tuple(names), np.ones(299), np.zeros(299), 1.0, 0.0)
    terms = tuple(f"tanh(({name} - 0.1234)/0.0321)*{name}" for name in names)
    found = equation("memory", terms, np.linspace(1, 2, 299), scaling, {"pressure": (0.0, 1.0)}, {})
    assert len(found.text) > 10_000


@pytest.mark.parametrize("digits", [1, 3, 6, 16])
def test_rounded_numbers_are_those_that_are_printed(digits):
    whole = parse("1234.5*x^2.3456 - 0.98765*exp(-(x - 0.12345678)/0.0345678)/y^-7.6543 + 1e-7*x^3")
    assert rounded(whole, digits) == parse(to_text(whole, digits))


@pytest.mark.parametrize(
    ("terms", "low"),
    [
        (("sqrt(1 + x)", "x"), -1.0),
        (("sqrt(1 + x)", "x", "x^2"), -1.0),
        (("sqrt(1 + x)", "exp(x)", "x"), 0.0),  # most terms are shorter with x + 1
    ],
)
def test_an_input_below_zero_is_shifted_if_most_terms_become_shorter(terms, low):
    scaling = scaling_of(["x"], [2], [4], "right", (1.0, 0.0))
    whole, where = summed(terms, np.ones(len(terms)), scaling, {})
    ends = {"x": np.array([2.0, 4.0])}
    (scaled,) = (evaluate(line, ends) for line in where.values())
    assert scaled == pytest.approx([low, low + 1])
    direct = {"x": np.array([-1.0, 0.0])}
    expected = sum(evaluate(parse(term), direct) for term in terms)
    assert evaluate(whole, dict.fromkeys(where, scaled)) == pytest.approx(expected)
