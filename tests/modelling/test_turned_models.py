"""A model of the strain as one of the force: it is inverted, and what no force makes has the force at the end of the range."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import built, curves

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.inverse import solve_for_input
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.recipe import Cuts

LEVELS = (80.0, 150.0, 250.0, 350.0)
OF_STRAIN = {"target": "strain", "cuts": {"force": Cuts("even", 3)}, "dictionary": ("1", "force", "force^2", "force^3"), "max_terms": 3}


def taut(n=60, noise=0.0, seed=0):
    """Strains that fall with the force in a straight line of each level: `(0.05 + 0.0005 P)(1 - F/(3 P))`, measured with noise."""
    rng = np.random.default_rng(seed)
    made = []
    for curve in curves(levels=LEVELS, held_out=(), n=n):
        force = np.linspace(0, 2 * curve.level, n)
        strain = (0.05 + 0.0005 * curve.level) * (1 - force / (3 * curve.level))
        columns = {"pressure": np.full(n, curve.level), "force": force, "strain": strain + rng.normal(0, noise, n) if noise else strain}
        made.append(replace(curve, columns=columns))
    return tuple(made)


MODEL = built(taut(), **OF_STRAIN)


@settings(max_examples=10)
@given(st.lists(st.tuples(st.floats(80, 350), st.floats(0.02, 0.98)), min_size=1, max_size=8))
def test_the_force_gives_the_strain_back(places):
    pressure, share = np.array(places).T
    force = share * 2 * 80.0  # a force that every level has seen
    strain = predict(MODEL, {"pressure": pressure, "force": force})
    found = solve_for_input(MODEL, {"pressure": pressure, "strain": strain}, "force")
    assert found.solved.all()
    np.testing.assert_allclose(predict(MODEL, {"pressure": pressure, "force": found.values}), strain, rtol=1e-6, atol=1e-9)


def test_the_law_that_made_the_strain_is_found_again():
    (curve, *_) = taut(noise=0.0)
    said = forecast(MODEL, curve, "force")
    inner = slice(3, -3)
    np.testing.assert_allclose(said.values[inner], curve.columns["force"][inner], atol=1e-3 * 160)
    np.testing.assert_array_equal(forecast(MODEL, curve, "strain").values, predict(MODEL, curve.columns))


def test_a_strain_that_no_force_makes_has_the_force_at_the_end_of_the_range():
    columns = {"pressure": np.array([150.0, 150.0, np.nan, 150.0]), "strain": np.array([0.9, -0.9, 0.1, np.nan])}
    found = solve_for_input(MODEL, columns, "force")
    assert found.solved.tolist() == [False] * 4
    assert np.isnan(found.values[2:]).all()
    fine = predict(MODEL, {"pressure": np.full(500, 150.0), "force": np.linspace(0, 700, 500)})
    for wanted, force in zip((0.9, -0.9), found.values[:2], strict=True):
        missed = abs(float(predict(MODEL, {"pressure": np.array([150.0]), "force": np.array([force])})[0]) - wanted)
        assert missed <= np.abs(fine - wanted).min() + 1e-9


def test_what_is_no_input_cannot_be_asked_for():
    with pytest.raises(UsageError, match="no input 'load'"):
        solve_for_input(MODEL, {"pressure": np.ones(1), "strain": np.ones(1)}, "load")
