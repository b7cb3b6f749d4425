"""A muscle behind a tendon: the force solves the equation of both, whatever the muscle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Body, Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.equations import as_equation
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.tendon import Tendon
from mapmore_cli.modelling.tendon.model import TendonVerbs, muscle_columns, solve
from mapmore_cli.pipeline.notebooks import LoadedModel

size = st.floats(0.5, 20)


@settings(max_examples=30)
@given(size, size, size, st.floats(-5, 5))
def test_a_straight_muscle_and_a_tendon_are_springs_in_series(a, b, k, at_zero):
    length = np.linspace(-1, 1, 7)
    found = solve(lambda own: a + b * own["length"], {"length": length}, k, at_zero)
    assert found == pytest.approx(
        (a + b * (length + at_zero / k)) / (1 + b / k), rel=1e-6, abs=1e-6
    )


def test_a_damped_muscle_follows_the_differential_equation_of_both():
    """`F = a + b l_m - c v_m` with `l_m = l - F/k` and `v_m = v + F'/k`, integrated by itself."""
    a, b, c, k = 5.0, 30.0, 0.5, 200.0
    time = np.arange(0.0, 3.0, 0.01)
    length, velocity = np.sin(2 * time), -2 * np.cos(2 * time)  # shortening is positive

    def rate(t, force):
        rest = a + b * (np.sin(2 * t) - force / k) - force
        return k * (rest / c + 2 * np.cos(2 * t))

    columns = {"time": time, "length": length, "velocity": velocity}
    found = solve(lambda own: a + b * own["length"] - c * own["velocity"], columns, k)
    true = solve_ivp(rate, (0, 3), found[:1], t_eval=time, rtol=1e-9, atol=1e-9).y[0]
    assert found[20:] == pytest.approx(true[20:], abs=0.01 * np.ptp(true))
    own = muscle_columns(columns, found, k, 0.0)
    assert own["length"] == pytest.approx(length - found / k)


def behind_a_tendon(*inputs):
    quantities, force = tuple(Quantity(name, "1") for name in inputs), Quantity("force", "N")
    muscle = Model("muscle", force, quantities, Body())
    return Model("both", force, quantities, Tendon(muscle, stiffness=60.0, force=2.0))


def test_a_muscle_behind_a_tendon_is_outside_its_range_by_its_own_length(monkeypatch):
    monkeypatch.setattr(kinds, "predict", lambda _muscle, own: 5 + 30 * own["length"])
    monkeypatch.setattr(kinds, "outside_range", lambda _muscle, own: own["length"] > 0.5)
    model, length = behind_a_tendon("length"), np.linspace(-1, 1, 99)
    force = (5 + 30 * (length + 2 / 60)) / 1.5
    outside = TendonVerbs().outside_range(model, {"time": np.arange(99.0), "length": length})
    assert outside.tolist() == (length - (force - 2) / 60 > 0.5).tolist()


def test_the_equations_distinguish_the_lengths_of_the_muscle_and_of_the_whole(monkeypatch):
    own = as_equation(
        "own", parse("rest_length*length - velocity + length_rate"), 6, weight="length < 3"
    )
    monkeypatch.setattr(kinds, "equations", lambda _muscle, _units: (own,))
    tendon, muscle = TendonVerbs().equations(behind_a_tendon("length", "velocity"), {})
    stretched = "muscle_length = length - (force - 2)/60"
    assert tendon.text == f"{stretched}, muscle_velocity = velocity + rate(force)/60"
    assert tendon.latex.startswith(r"\text{muscle\_length = length")
    renamed = parse("rest_length*muscle_length - muscle_velocity + length_rate")
    assert muscle == as_equation("own", renamed, 6, weight="muscle_length < 3")
    assert TendonVerbs().equations(behind_a_tendon("length"), {})[0].text == stretched


@pytest.mark.parametrize(
    ("inputs", "there", "missing"),
    [
        (("length", "velocity"), ("length", "velocity"), "time"),
        (("length", "velocity"), ("length",), "time and velocity"),
        (("length", "velocity"), ("time", "length"), "velocity"),
        (("length",), ("length",), "time"),
    ],
)
def test_a_column_that_a_muscle_behind_a_tendon_lacks_is_named(inputs, there, missing, monkeypatch):
    monkeypatch.setattr(kinds, "predict", lambda _muscle, own: 5 + 30 * own["length"])
    model = behind_a_tendon(*inputs)
    columns = {"time": np.arange(7.0), "length": np.linspace(-1, 1, 7), "velocity": np.zeros(7)}
    some = {name: columns[name] for name in there}
    with pytest.raises(DataError, match=f"a force behind a tendon .* table lacks {missing}\n"):
        TendonVerbs().simulate(model, some)
    with pytest.raises(TypeError, match=f"a function of {', '.join(['time', *inputs])}; got"):
        LoadedModel(model)(**some)
    found = TendonVerbs().simulate(model, columns).values
    assert found == pytest.approx((5 + 30 * (columns["length"] + 2 / 60)) / 1.5, abs=1e-6)
