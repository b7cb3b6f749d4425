"""What follows from an operator's recursion: its values along a recording, a free run, derivatives and C."""

from __future__ import annotations

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmore_cli.modelling.expressions import operators
from mapmore_cli.modelling.expressions.operator import FLOATS, Setting, along, followed
from mapmore_cli.modelling.expressions.operators import OPERATORS, families
from mapmore_cli.modelling.program.model import recursion_slopes

sys.path.append(str(Path(__file__).parents[2] / "exporting"))

PATHS = arrays(float, st.integers(1, 40), elements=st.floats(-10, 10, width=16))
NUMBERS = {"tau": (0.05, 0.1), "widths": (0.11,), "frequency": (4.0, 0.2), "p": (1.5, 7.0), "rate": (3.0,), "v": (0.05, 0.2)}


def setting_of(name):
    parameters = OPERATORS[name].parameters
    return Setting(NUMBERS[parameters[0].key][: len(parameters)] if parameters else (), 0.01, (-3.0, 4.0))


def sample_by_sample(operator, setting, x):
    """The recursion from rest, its arguments put together here."""
    rule = operator.recursion(setting)
    own, source = [rule.rest(x[0])] * rule.own, [x[0]] * rule.source
    values = []
    for now in x:
        values.append(rule.next(FLOATS, *own, now, *source))
        own = [values[-1], *own][: rule.own]
        source = [now, *source][: rule.source]
    return np.array(values)


@pytest.mark.parametrize("name", OPERATORS)
@settings(deadline=None, max_examples=40)
@given(x=PATHS)
def test_every_way_along_a_recording_is_the_recursion(name, x):
    operator, setting = OPERATORS[name], setting_of(name)
    expected = sample_by_sample(operator, setting, x)
    np.testing.assert_allclose(along(operator, x, setting), expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(followed(operator.recursion(setting), x), expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(followed(replace(operator.recursion(setting), weights=None), x), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", OPERATORS)
def test_slopes_are_the_derivatives_of_the_recursion(name):
    rule = OPERATORS[name].recursion(setting_of(name))
    rng = np.random.default_rng(1)
    arguments = rng.uniform(-4, 5, (rule.own + rule.source + 1, 200))
    slopes = recursion_slopes(rule, arguments)
    by_statements = recursion_slopes(replace(rule, weights=None), arguments)
    assert len(slopes) == len(arguments)
    for place, slope in enumerate(slopes):
        shift = np.zeros((len(arguments), 1))
        shift[place] = 1e-6
        above, below = (np.array([rule.next(FLOATS, *column) for column in (arguments + sign * shift).T]) for sign in (1, -1))
        np.testing.assert_allclose(np.broadcast_to(slope, 200), (above - below) / 2e-6, atol=1e-7)
        np.testing.assert_allclose(np.broadcast_to(by_statements[place], 200), np.broadcast_to(slope, 200), atol=1e-15)


@pytest.mark.parametrize("name", OPERATORS)
def test_a_resting_source_keeps_the_recursion_at_rest(name):
    rule = OPERATORS[name].recursion(setting_of(name))
    assert rule.next(FLOATS, *[rule.rest(1.5)] * rule.own, *[1.5] * (rule.source + 1)) == pytest.approx(rule.rest(1.5), abs=1e-12)


def test_a_family_writes_the_operators_that_name_it():
    assert [operator.name for operator in families()["resonance"]] == ["resonance", "resonance_velocity"]
    assert sum(map(len, families().values())) == len(OPERATORS)


NEW = '''
"""Rate-limited following: a valve that opens no faster than its motor."""
from mapmore_cli.modelling.expressions.operator import Operator, Parameter, Recursion


def recursion(setting):
    most = setting.numbers[0] * setting.step
    soft = lambda m, s, x: s + most * m.call("tanh", (x - s) / most)
    return Recursion(
        1, 1, lambda m, s, x, before: m.where(x > before, lambda: soft(m, s, x), lambda: m.clip(x, s - most, s + most)), lambda x: x
    )


OPERATORS = (Operator("valve", "A rate limit.", recursion, (Parameter("rate", "1", "90"),)),)
'''


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler here")
def test_an_operator_of_one_file_is_evaluated_fed_back_and_compiled(tmp_path, monkeypatch):
    """Nothing else knows of it: its file is found, and its C equals its prediction, in a model driven by inputs and by its output."""
    from agreement import compare
    from export_samples import memory

    (tmp_path / "valve.py").write_text(NEW)
    monkeypatch.setattr(operators, "__path__", [*operators.__path__, str(tmp_path)])
    found, with_it = OPERATORS, {operator.name: operator for operator in operators._found()}
    for module in list(sys.modules.values()):
        if vars(module).get("OPERATORS") is found:
            monkeypatch.setattr(module, "OPERATORS", with_it)
    states = ("valve(pressure, 900)", "valve(force[k-1], 2000)", "pressure")
    model = memory(states, (*states, "valve(pressure, 900)*valve(force[k-1], 2000)"), gain=30.0)
    assert compare(model, tmp_path, 3_000)[0] < 1e-12
