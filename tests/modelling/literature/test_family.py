"""A family of muscles: one function, scaled by a largest force that follows from a dimension."""

import json

import numpy as np
import pytest

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import evaluate
from mapmore_cli.modelling.literature import family, own
from mapmore_cli.modelling.literature.own import FamilySettings, definition, formula_of

LENGTHS = (0.1, 0.2, 0.3)


def force(pressure, strain, length, scale=1.0, stretch=1.0):
    """A muscle that is slack below a threshold; its largest force follows Bolen's law."""
    largest = 300 * np.arctan(19.03 * (length - 0.0075))
    share = pressure / 600 * (1 - stretch * strain / 0.25) ** 2 - 0.1 * stretch * strain / 0.25
    return np.asarray(-8.0 + scale * largest * np.maximum(share, 0.0))


def measured(lengths):
    """Pressures at five strains of each length."""
    rows = np.array(
        [
            (p, e, one)
            for one in lengths
            for e in (0.0, 0.05, 0.1, 0.15, 0.2)
            for p in np.linspace(0, 600, 25)
        ]
    )
    columns = dict(zip(("pressure", "strain", "length"), rows.T, strict=True))
    return columns, np.concatenate(
        [force(*(rows[rows[:, 2] == one].T[:2]), one) for one in lengths]
    )


def fitted(lengths=LENGTHS, metres=1.0):
    columns, y = measured(lengths)
    columns["length"] = columns["length"] / metres
    return literature.get(FamilySettings(of="length").definition(metres)).fit(columns, y)


def test_a_length_never_measured_is_predicted():
    fit = fitted((0.1, 0.3))
    columns, y = measured((0.2,))
    predicted = literature.of(fit).predict(fit.parameters, columns)
    assert np.sqrt(np.mean((predicted - y) ** 2)) < 0.03 * np.abs(y).max()
    equation = literature.of(fit).equation(fit)
    np.testing.assert_allclose(evaluate(equation, columns), predicted, rtol=1e-6, atol=1e-6)
    assert fit.parameters["zero"] == pytest.approx(-8.0)
    assert fit.parameters["b"] == pytest.approx(19.03, rel=0.15)
    assert "2 specimens" in fit.notes[0]


@pytest.mark.parametrize("metres", [1e-3, 10.0])
def test_another_unit_makes_the_same_family(metres):
    one, other = fitted(), fitted(metres=metres)
    columns, _ = measured(LENGTHS)
    expected = literature.of(one).predict(one.parameters, columns)
    columns["length"] = columns["length"] / metres
    assert literature.of(other).predict(other.parameters, columns) == pytest.approx(
        expected, abs=1e-6
    )


def test_a_diameter_scales_by_a_power():
    columns, _ = measured((0.2,))
    parts = [{**columns, "length": np.full(125, d)} for d in (10.0, 20.0)]
    y = np.concatenate(
        [force(columns["pressure"], columns["strain"], 0.2) * (d / 10) ** 2.2 for d in (10.0, 20.0)]
    )
    definition = FamilySettings(of="length", scale="power").definition(1.0)
    fit = literature.get(definition).fit(
        {name: np.concatenate([part[name] for part in parts]) for name in columns}, y
    )
    assert fit.parameters["b"] == pytest.approx(2.2, abs=0.05)  # drawn a little towards the prior


def test_one_specimen_is_no_family():
    with pytest.raises(DataError, match="a family needs several specimens"):
        fitted((0.2,))


def test_samples_of_one_strain_count_as_one_of_five_per_cent():
    """`sum (missed/(.05 F))^2/n_e + sum ((q - 1)/.15)^2` is least, n_e samples at each hundredth of
    the range of the strain.
    """
    fit = fitted()
    strain = np.repeat([0.0, 0.082, 0.086, 0.2], [3, 1, 5, 2])  # 41 and 43 hundredths
    columns = {"pressure": np.linspace(300, 600, 11), "strain": strain}
    y = force(columns["pressure"], strain, 0.2, scale=1.2, stretch=1.1) + 9 * (strain == 0.086)
    made = family.adapted(fit, columns, y, 0.2)
    n = np.repeat([3, 1, 5, 2], [3, 1, 5, 2])

    def missed(q):
        scales = dict(zip(("q_force", "q_strain"), q, strict=True))
        said = literature.of(made).predict({**made.parameters, **scales}, columns)
        return np.append((said - y) / (0.05 * np.abs(y).max()) / np.sqrt(n), (q - 1) / 0.15)

    best = np.array([made.parameters["q_force"], made.parameters["q_strain"]])
    steps = 1e-5 * np.eye(2)
    slopes = np.transpose([(missed(best + step) - missed(best - step)) / 2e-5 for step in steps])
    assert slopes.T @ missed(best) == pytest.approx([0, 0], abs=1e-3)
    errors = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert [made.errors["q_force"], made.errors["q_strain"]] == pytest.approx(errors, rel=1e-4)
    assert best == pytest.approx([1.2, 1.1], abs=0.1)


def test_without_points_a_specimen_is_the_family_at_its_length():
    fit = fitted()
    columns, _ = measured((0.2,))
    made = family.adapted(fit, {}, np.empty(0), 0.2)
    assert set(literature.of(made).inputs) == {"pressure", "strain"}
    expected = literature.of(fit).predict(fit.parameters, columns)
    assert literature.of(made).predict(made.parameters, columns) == pytest.approx(
        expected, rel=1e-9
    )
    assert made.errors["q_force"] == 0.15


@pytest.mark.parametrize(
    "text",
    [
        '{"family": 3}',
        '{"family": {}}',
        '{"family": {"of": "exp(9)", "scale": "power", "metres": 1}}',
        '{"family": {"of": "x", "scale": "power", "metres": -1}}',
        '{"family": {"of": "x", "scale": "power", "metres": 0}}',
        '{"family": {"of": "x", "scale": "cubic", "metres": 1}}',
        '{"family": [',
    ],
)
def test_what_defines_no_family(text):
    with pytest.raises(ValueError, match=r"family|formula|Expecting"):
        literature.get(text)


def test_the_text_of_a_definition_does_not_hang_on_the_order_of_its_keys():
    bounds, units = {"b": (1.0, 2.0), "a": None}, {"b": "m", "a": "N"}
    turned = [dict(reversed(one.items())) for one in (bounds, units)]
    plain = definition("own", "here", "a*exp(b*x)", bounds, units)
    assert plain == definition("own", "here", "a*exp(b*x)", *turned)
    wide = definition("own", "here", "f*p + e*q + d*r + c*s + b*t", dict.fromkeys("tpsqr"), {})
    assert (formula_of(wide).parameters, formula_of(wide).inputs) == (
        tuple("pqrst"),
        tuple("bcdef"),
    )
    for text in (plain, FamilySettings(of="length").definition(1.0)):
        assert text == json.dumps(json.loads(text), sort_keys=True)


def test_a_definition_has_a_largest_length(monkeypatch):
    text = definition("of some length", "here", "a*x", {"a": None}, {})
    monkeypatch.setattr(own, "LONGEST", len(text))
    assert formula_of(text).parameters == ("a",)
    with pytest.raises(ValueError, match=f"has {len(text) + 1} characters"):
        formula_of(text + " ")


@pytest.mark.parametrize(
    ("bounds", "parts"),
    [
        ((1.0, 5.0), [(1.0, 5.0)]),
        ((-5.0, -1.0), [(-5.0, -1.0)]),
        ((-2.0, 5.0), [(-2.0, -5e-4), (5e-4, 5.0)]),
        ((-5.0, 2.0), [(-5.0, -5e-4), (5e-4, 2.0)]),
        ((0.0, 5.0), [(5e-4, 5.0)]),
        ((-5.0, 0.0), [(-5.0, -5e-4)]),
    ],
)
def test_bounds_of_a_formula_of_a_spec_are_searched_in_parts_of_one_sign(bounds, parts):
    """Values below a ten-thousandth of the larger bound are left out."""
    text = definition("own", "here", "a*exp(b*x)", {"a": None, "b": bounds}, {"a": "N"})
    made = formula_of(text)
    (parameter,) = made.nonlinear
    assert [*parameter.intervals] == [pytest.approx(part) for part in parts]
    assert (made.inputs, made.parameters, made.linear) == (("x",), ("a", "b"), ("a",))
    assert (made.units, made.definition) == ({"a": "N"}, text)
