"""Gains and offsets of groups, estimated from curves whose effects are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, Grouping
from mapmore_cli.fitting.groups import (
    GroupEffects,
    _GroupFit,
    _polynomial,
    _require_apart,
    group_effects,
)

GROUP = np.repeat([1.0, 2.0, 5.0], 100)
GAINS = {1.0: 1.25, 2.0: 1.0, 5.0: 0.8}


def effects(y, out=None, group=GROUP, x=None, columns=None, **asked):
    x = np.random.default_rng(2).uniform(-1, 1, len(y)) if x is None else x
    out = np.zeros(len(y), dtype=bool) if out is None else out
    columns = {"x": x, "g": group, "y": y, **(columns or {})}
    curve = Curve("all", None, columns, out, ("a",))
    return group_effects([curve], Grouping("y", "g", **asked))


def of_groups(noise=0.0, offsets=(1.0, -2.0, 1.0)):
    """A curve of x in three groups, with their gains and offsets."""
    x, rng = np.random.default_rng(2).uniform(-1, 1, 300), np.random.default_rng(3)
    gain = np.repeat([*GAINS.values()], 100)
    return gain * (2 + np.exp(x)) + np.repeat(offsets, 100) + rng.normal(0, noise, 300)


@given(st.floats(1e-3, 1e3), st.floats(-50, 50), st.sampled_from([0.0, 0.01, 0.1]))
@settings(max_examples=20)
def test_gains_are_found_and_do_not_depend_on_the_unit(unit, zero, noise):
    y = of_groups(noise)
    of = effects(y, gain=True, offset=True)
    assert of.gains == pytest.approx(GAINS, rel=0.005 + noise)
    assert effects(unit * (y + zero), gain=True, offset=True).gains == pytest.approx(
        of.gains, rel=1e-4
    )
    alone = effects(of_groups(noise, (0, 0, 0)), gain=True)
    assert (alone.gains, alone.offsets) == (pytest.approx(GAINS, rel=0.005 + noise), {})


def test_effects_are_taken_off_and_told():
    columns = {"g": np.array([1.0, 2.0, 5.0]), "y": np.array([5.0, 7.0, 9.0])}
    columns["y_uncertainty"] = np.array([0.5, 0.5, 0.5])
    curve = Curve("all", None, columns, np.zeros(3, dtype=bool), ("a",))
    of = GroupEffects("g", {1.0: 2.0}, {1.0: 3.0, 2.0: -3.0}, (5.0,))
    assert of.removed_from(curve, "y").columns["y"].tolist() == [1.0, 10.0, 9.0]
    assert of.removed_from(curve, "y").columns["y_uncertainty"].tolist() == [0.25, 0.5, 0.5]
    again = of.removed_from(curve, "y").at(np.array([2, 0])).raw("y").columns
    assert (again["y"].tolist(), again["y_uncertainty"].tolist()) == ([9.0, 5.0], [0.5, 0.5])
    assert curve.columns["y"].tolist() == [5.0, 7.0, 9.0]
    assert list(of.describe("y", "N")) == [
        "gains of g, by which y is divided: 1: 2; 5 is held out completely and gets a gain of 1",
        "offsets of g [N], which are subtracted from y: 1: +3, 2: -3; "
        "for 5, which is held out completely, the offset is not known",
    ]


def test_a_group_without_training_samples_has_no_effects():
    of = effects(of_groups(), GROUP == 5, offset=True, gain=True)
    assert (of.unknown, [*of.gains], [*of.offsets]) == ((5.0,), [1.0, 2.0], [1.0, 2.0])


def test_gains_that_nothing_tells_are_near_one():
    """Noise of ten times the signal, and one sample of a group."""
    some = np.append(np.arange(200), 299)
    x = np.random.default_rng(2).uniform(-1, 1, 300)[some]
    gains = effects(of_groups(30.0)[some], group=GROUP[some], x=x, gain=True).gains
    assert all(0.7 < gain < 1.4 for gain in gains.values()), gains


def test_effects_do_not_depend_on_held_out_outputs_and_move_with_the_target():
    rng = np.random.default_rng(2)
    out, y = rng.random(300) < 0.3, of_groups()
    for asked in ({"offset": True}, {"offset": True, "gain": True}):
        of = effects(y, out, **asked)
        assert effects(np.where(out, rng.normal(size=300), y), out, **asked) == of
        moved = effects(3 * y + 7, out, offset=True).offsets
        assert moved == pytest.approx(
            {value: 3 * offset for value, offset in effects(y, out, offset=True).offsets.items()}
        )
    equal = effects(of_groups() / np.repeat([*GAINS.values()], 100), out, offset=True).offsets
    assert sum(equal.values()) == pytest.approx(0, abs=1e-9)


def test_inputs_are_those_that_vary_within_a_group():
    """In the first group only, and in none."""
    group = np.repeat([1.0, 2.0], 50)
    x = np.where(group == 1, np.tile(np.linspace(-1, 1, 50), 2), 0.5)
    y = 3 * x + np.where(group == 1, 1.0, -1.0)
    found = effects(y, group=group, x=x, columns={"size": 2 * group}, offset=True)
    assert found.offsets == pytest.approx({1: 1, 2: -1})


def test_another_output_is_not_an_input_of_the_groups():
    y = of_groups(0.1)
    with_other = effects(y, columns={"z": 2 * y}, gain=True, outputs=("y", "z"))
    assert with_other == effects(y, gain=True)


def test_groups_share_a_polynomial_of_order_three():
    x, y = np.array([0.0, 1.0, 4.0]), np.array([5.0, 5.0, 9.0])
    a, b = np.array([-1, -0.5, 1]), np.array([-1.0, -1, 1])
    one = np.ones(3)
    quadratic, cubic = [a * a, a * b, b * b], [a**3, a * a * b, a * b * b, b**3]
    expected = np.stack([one, a, b, *quadratic, *cubic], axis=1)
    np.testing.assert_allclose(_polynomial([x, y], 3), expected)


def test_residuals_are_as_large_as_those_of_a_line_for_each_group():
    rng, squares, tables = np.random.default_rng(0), 0.0, []
    for size in (5, 9):
        x, y = rng.normal(size=(2, size))
        line = np.column_stack([x, np.ones(size)])
        squares += float(np.linalg.lstsq(line, y, rcond=None)[1][0])
        tables.append(np.column_stack([line, y]))
    found = _GroupFit([*tables, tables[0][:2]], np.eye(3), offset=False)  # a group of two samples
    assert found.scatter == pytest.approx(np.sqrt(squares / (5 - 2 + 9 - 2)))


def test_what_goes_with_the_group_is_no_offset():
    group = np.repeat([1.0, 2.0], 50)
    # varies within a group, and tells nothing
    x = np.where(group == 1, 0.0, 1.0) + np.tile(np.linspace(0, 1e-9, 50), 2)
    with pytest.raises(DataError, match="cannot be separated"):
        effects(x, group=group, x=x, offset=True)


@pytest.mark.parametrize(("left", "told_apart"), [(3e-6, True), (3e-7, False)])
def test_an_offset_needs_a_millionth_of_its_own(left, told_apart):
    """Of the indicator of a group, what the polynomial of the inputs leaves."""
    common, coded = np.array([[1.0], [0.0]]), np.array([[np.sqrt(1 - left**2)], [left]])
    if told_apart:
        _require_apart(common, coded, "muscle", ["pressure"])
    else:
        with pytest.raises(DataError, match="cannot be separated from the effects of pressure"):
            _require_apart(common, coded, "muscle", ["pressure"])
