"""What every operator declares of itself agrees: along a recording, sample by sample, and its derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmore_cli.modelling.terms.operator import Setting
from mapmore_cli.modelling.terms.operators import OPERATORS, families

PATHS = arrays(float, st.integers(1, 40), elements=st.floats(-10, 10, width=16))
NUMBERS = {"tau": (0.05,), "widths": (0.11,), "frequency": (4.0, 0.2)}


def setting_of(name):
    parameters = OPERATORS[name].parameters
    return Setting(NUMBERS[parameters[0].key] if parameters else (), 0.01, (-3.0, 4.0))


def sample_by_sample(operator, setting, x):
    """The recursion from rest, its arguments put together here."""
    rule = operator.recursion(setting)
    own, source = [rule.rest(x[0])] * rule.own, [x[0]] * rule.source
    values = []
    for now in x:
        values.append(rule.next(*own, now, *source))
        own = [values[-1], *own][: rule.own]
        source = [now, *source][: rule.source]
    return np.array(values)


@pytest.mark.parametrize("name", OPERATORS)
@settings(deadline=None, max_examples=40)
@given(x=PATHS)
def test_along_a_recording_and_sample_by_sample_are_the_same(name, x):
    operator, setting = OPERATORS[name], setting_of(name)
    np.testing.assert_allclose(sample_by_sample(operator, setting, x), operator.along(x, setting), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", OPERATORS)
def test_slopes_are_the_derivatives_of_the_recursion(name):
    operator, setting = OPERATORS[name], setting_of(name)
    rule = operator.recursion(setting)
    rng = np.random.default_rng(1)
    arguments = rng.uniform(-4, 5, (rule.own + rule.source + 1, 200))
    moved = np.array([rule.next(*column) for column in arguments.T])
    slopes = rule.slopes(moved, arguments[rule.own])
    assert len(slopes) == len(arguments)
    for place, slope in enumerate(slopes):
        shift = np.zeros((len(arguments), 1))
        shift[place] = 1e-6
        above, below = (np.array([rule.next(*column) for column in (arguments + sign * shift).T]) for sign in (1, -1))
        np.testing.assert_allclose(np.broadcast_to(slope, 200), (above - below) / 2e-6, atol=1e-7)


@pytest.mark.parametrize("name", OPERATORS)
def test_a_resting_source_keeps_the_recursion_at_rest(name):
    operator, setting = OPERATORS[name], setting_of(name)
    rule = operator.recursion(setting)
    assert rule.next(*[rule.rest(1.5)] * rule.own, *[1.5] * (rule.source + 1)) == pytest.approx(rule.rest(1.5), abs=1e-12)


def test_a_family_writes_the_operators_that_name_it():
    assert [operator.name for operator in families()["resonance"]] == ["resonance", "resonance_velocity"]
    assert sum(map(len, families().values())) == len(OPERATORS)
