"""Operators: against their recursions, written out sample by sample; and what follows from a
recursion, a free run, derivatives and C.
"""

from dataclasses import replace

import numpy as np
import pytest
from common import files_without_parts
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp

from mapmore_cli.modelling.expressions import Name, operators
from mapmore_cli.modelling.expressions.operator import (
    FLOATS,
    Operator,
    Setting,
    along,
    from_rest,
)
from mapmore_cli.modelling.expressions.operators import OPERATORS, families
from mapmore_cli.modelling.program.slopes import with_slopes_by
from mapmore_cli.modelling.program.values import ready_for_columns
from mapmore_cli.modelling.program.writing import Writer

STEP = 0.01
PATHS = arrays(float, st.integers(1, 60), elements=st.floats(-10, 10, width=16))
WIDTHS = st.floats(0.01, 20)
NUMBERS = {
    "tau": (0.05, 0.1),
    "widths": (0.11,),
    "frequency": (4.0, 0.2),
    "p": (1.5, 7.0),
    "rate": (3.0,),
    "v": (0.05,),
}


def setting_of(name):
    parameters = OPERATORS[name].parameters
    return Setting(
        NUMBERS[parameters[0].key][: len(parameters)] if parameters else (), STEP, (-3.0, 4.0)
    )


def state_of(name, x, *numbers):
    """An operator along x, whose training range is one."""
    return along(OPERATORS[name], x, Setting(numbers, STEP, (0.0, 1.0)))


@pytest.mark.parametrize("name", OPERATORS)
def test_only_an_operator_whose_values_depend_on_the_step_is_timed(name):
    x, setting = np.sin(np.arange(40.0)), setting_of(name)
    values, slower = (
        along(OPERATORS[name], x, replace(setting, step=step)) for step in (STEP, 2 * STEP)
    )
    assert OPERATORS[name].timed != np.array_equal(values, slower)


@given(PATHS, WIDTHS, st.lists(st.integers(1, 4), min_size=60, max_size=60))
def test_play_follows_its_recursion_however_fast_the_path_is_run(x, width, repeats):
    w, each = x[0], np.array(repeats[: len(x)])
    expected = [w := min(max(w, now - width), now + width) for now in x]
    np.testing.assert_array_equal(state_of("play", x, width), expected)
    np.testing.assert_array_equal(
        state_of("play", np.repeat(x, each), width)[np.cumsum(each) - 1], expected
    )


def test_resonance_answers_an_impulse_as_a_damped_oscillator_of_unit_gain():
    damping, w, k = 0.1, 2 * np.pi * 4.0, np.arange(4000)
    turned = w * STEP * np.sqrt(1 - damping**2)
    free = np.exp(-damping * w * STEP * k) * np.sin(turned * (k + 1))
    x = np.r_[0.0, 1.0, np.zeros(3999)]
    y = state_of("resonance", x, 4.0, damping)
    np.testing.assert_allclose(y[1:], free / free.sum(), atol=1e-12)
    v = state_of("resonance_velocity", x, 4.0, damping)
    np.testing.assert_allclose(v[1:], np.diff(y) / (w * STEP), atol=1e-12)


def solved(rate, start, span):
    """The end of the solution of `ds/da = rate(s)` over a distance a."""
    return solve_ivp(lambda _, s: rate(s), (0, span), [start], rtol=1e-9, atol=1e-11).y[0, -1]


def hysteresis(p, q):
    """The law of Bouc and Wen over one change of x, whose training range has a width of 7."""

    def law(z, x, before):
        sign = np.sign(x - before)
        rate = lambda z: sign - np.where(sign * z > 0, p, -q) * sign * abs(z)  # noqa: E731
        return solved(rate, z, abs(x - before) / 7)

    return law


# each operator at the numbers of `setting_of`, from its last value and two values of the source
LAWS = {
    "slow": lambda s, x, _: solved(lambda s: (x - s) / 0.05, s, STEP),
    "creep": lambda s, x, _: solved(lambda s: 0.7 / 0.05 * np.sinh((x - s) / 0.7), s, STEP),
    "rate": lambda _, x, before: (x - before) / STEP,
    "direction": lambda s, x, before: np.sign(x - before) or s,
    "coulomb": lambda _, x, __: np.tanh(x / (0.05 * 7)),
    "saturate": lambda _, x, __: min(max(x, -3.0), 4.0),
    "wen": hysteresis(1.5, 7.0),
    "wen_stiffening": hysteresis(1.5, 7.0),
    "dahl": hysteresis(3.0, 3.0),
}


@pytest.mark.parametrize("name", LAWS)
def test_operators_follow_their_laws(name):
    """The laws of creep and hysteresis are differential equations, which SciPy integrates."""
    x = np.array([0.2, 0.2, 0.5, 1.9, 3.1, 4.5, 4.4, 3.0, 1.2, 0.1, -1.7, -3.4, -2.0, -2.0, 0.3])
    s, expected = x[0] * (name in ("slow", "creep")), []
    for now, before in zip(x, [x[0], *x], strict=False):
        expected.append(s := LAWS[name](s, now, before))
    found = along(OPERATORS[name], x, setting_of(name))
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9)


def test_a_state_that_grows_without_bound_remains_a_number():
    far = np.array([0.0, 20.0, -20.0, 20.0])  # ranges of training
    found = along(OPERATORS["wen_stiffening"], far, Setting((-60.0, 8.0), STEP, (0.0, 1.0)))
    assert np.abs(found).max() == pytest.approx(np.expm1(700) / 60)


RATE = (0, 1e4)
WIDTHS = [(1e-3, 0.5)], 5, (0.02,), (0.35,)
SEARCHES = {
    "coulomb": ([(1e-4, 4)], 5, (0.001,), (0.25,)),
    "slow": ([(0.005, 4000)], 6, (0.1,), (40,)),
    "creep": ([(0.01, 4000), (0.005, 10)], 8, (0.1, 0.03), (160, 0.2)),
    "play": WIDTHS,
    "stop": WIDTHS,
    "wen": ([RATE, RATE], 16, (0, 0), (32, 32)),
    "wen_stiffening": ([(-8, 1e4), RATE], 21, (-4, 8), (32, 32)),
    "dahl": ([RATE], 6, (1,), (1024,)),
}


def test_the_numbers_that_training_tries_have_limits_and_beginnings_within_them():
    """Half a step or one step, and a hundred times the longest piece of 40 s, for times."""
    assert SEARCHES.keys() == {name for name, one in OPERATORS.items() if one.starts}
    for name, (limits, count, first, last) in SEARCHES.items():
        parameters, starts = OPERATORS[name].parameters, OPERATORS[name].starts(0.01, 40.0)
        assert np.array([one.between(0.01, 40.0) for one in parameters]) == pytest.approx(
            np.array(limits)
        )
        assert (len(starts), starts[0], starts[-1]) == (count, first, last), name
        for numbers in starts:
            for number, parameter, (low, high) in zip(numbers, parameters, limits, strict=True):
                assert parameter.allows(number)
                assert low <= number <= high


@pytest.mark.parametrize("name", SEARCHES)
def test_a_search_begins_at_numbers_that_are_neither_alike_nor_far_apart(name):
    for tried in map(np.unique, np.transpose(OPERATORS[name].starts(0.01, 40.0))):
        for sizes in (tried[tried > 0], -tried[tried < 0][::-1]):
            ratios = sizes[1:] / sizes[:-1]
            assert ((ratios > 1.7) & (ratios < 12)).all()


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
@settings(max_examples=40)
@given(x=PATHS, empty=st.integers(1, 5))
def test_every_way_along_a_recording_is_the_recursion(name, x, empty):
    """What the source leaves empty at the beginning stays empty."""
    operator, setting = OPERATORS[name], setting_of(name)
    expected = sample_by_sample(operator, setting, x)
    rule = operator.recursion(setting)
    late = along(operator, np.r_[np.full(empty, np.nan), x], setting)
    assert np.isnan(late[:empty]).all()
    for found in (
        along(operator, x, setting),
        from_rest(rule, x),
        from_rest(replace(rule, weights=None), x),
        late[empty:],
    ):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    assert np.isnan(along(operator, np.full(empty, np.nan), setting)).all()
    assert len(along(operator, np.empty(0), setting)) == 0


@pytest.mark.parametrize("name", OPERATORS)
def test_a_piece_goes_on_from_the_values_before_it(name):
    """Also from one value only, which then stands for all earlier ones."""
    operator, setting, x = OPERATORS[name], setting_of(name), np.r_[1.0, 1.0, 3.0, -2.0, 4.5, 0.5]
    whole = along(operator, x, setting)
    for begun in (2, 4):
        empty = np.full(begun - 1, np.nan)
        before = np.r_[empty, whole[:begun]], np.r_[empty, x[:begun]]
        found = along(operator, x[begun:], setting, before)
        np.testing.assert_allclose(found, whole[begun:], atol=1e-12)
    found = along(operator, x[2:], setting, (whole[1:2], x[1:2]))
    np.testing.assert_allclose(found, whole[2:], atol=1e-12)


@pytest.mark.parametrize("name", OPERATORS)
def test_slopes_are_the_derivatives_of_the_recursion(name):
    rule = OPERATORS[name].recursion(setting_of(name))
    rng = np.random.default_rng(1)
    arguments = rng.uniform(-4, 5, (rule.own + rule.source + 1, 200))
    m, names = Writer(), [f"argument_{place}" for place in range(len(arguments))]
    block = m.side(lambda: rule.next(m, *map(Name, names)))
    run = ready_for_columns(with_slopes_by(block, names), ())
    slopes = run(dict(zip(names, arguments, strict=True)), 200)
    assert len(slopes) == len(arguments)
    for place, slope in enumerate(slopes):
        shift = np.zeros((len(arguments), 1))
        shift[place] = 1e-6
        above, below = (
            np.array([rule.next(FLOATS, *column) for column in (arguments + sign * shift).T])
            for sign in (1, -1)
        )
        np.testing.assert_allclose(np.broadcast_to(slope, 200), (above - below) / 2e-6, atol=1e-7)


@pytest.mark.parametrize("name", OPERATORS)
def test_a_source_that_did_not_vary_in_training_has_states(name):
    setting = replace(setting_of(name), limits=(2.0, 2.0))
    found = along(OPERATORS[name], x := np.array([2.0, 2.0, 3.0, 1.0]), setting)
    assert np.isfinite(found).all()
    if name in ("coulomb", "creep"):  # a width of one
        one = Setting((*setting.numbers[:-1], 1.0), STEP, (0.0, 1.0))
        assert found.tolist() == along(OPERATORS[name], x, one).tolist()


@pytest.mark.parametrize("name", OPERATORS)
def test_a_resting_source_keeps_the_recursion_at_rest(name):
    rule = OPERATORS[name].recursion(setting_of(name))
    assert rule.next(
        FLOATS, *[rule.rest(1.5)] * rule.own, *[1.5] * (rule.source + 1)
    ) == pytest.approx(rule.rest(1.5), abs=1e-12)


def test_every_file_of_the_folder_declares_an_operator():
    assert files_without_parts("operators", Operator, operators) == set()


def test_a_family_writes_the_operators_that_name_it():
    assert [operator.name for operator in families()["resonance"]] == [
        "resonance",
        "resonance_velocity",
    ]
    assert {one for family in families().values() for one in family} == {
        operator for operator in OPERATORS.values() if operator.parameters
    }
