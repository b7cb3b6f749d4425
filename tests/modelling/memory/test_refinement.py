"""Free run as the criterion: derivatives of runs, coefficients of least simulation error, terms
chosen by their runs.
"""

from dataclasses import replace

import numpy as np
import pytest
from memory_samples import memory_model, recipe_of, record, state_set, wandering

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.memory.feedback import Feedback
from mapmore_cli.modelling.memory.fitting import fit_with_memory
from mapmore_cli.modelling.memory.free_run import Along
from mapmore_cli.modelling.memory.refinement import (
    THOROUGH,
    FreeRunProblem,
    free_run_errors,
    minimise,
    refine,
    sensitivities,
)
from mapmore_cli.modelling.memory.simulation import ReadyPiece

TERMS = {
    "x": 0.5,
    "y[k-1]": 0.3,
    "x*y[k-2]": 0.2,
    "stop(y[k-1], 0.2)": -0.4,
    "slow(play(y[k-1], 0.1), 0.05)^2": 0.3,
    "resonance(y[k-1], 6, 0.2)[k-1]": 0.2,
    "x*resonance_velocity(y[k-2], 6, 0.2)": 0.1,
    "exp(-saturate(y[k-1]))": 0.1,
    "1": 0.05,
}
NAMES = ("x", "y[k-1]", "y[k-2]", "stop(y[k-1], 0.2)", "slow(play(y[k-1], 0.1), 0.05)",
    "resonance(y[k-1], 6, 0.2)[k-1]",
         "resonance_velocity(y[k-2], 6, 0.2)", "saturate(y[k-1])")  # fmt: skip
WIDE = (-1e9, 1e9)


def course(terms, names, x, y, scaled=False):
    scales = {"low": [-0.7] * len(names), "high": [0.9] * len(names)} if scaled else {}
    states = state_set(*names, ranges={"y[k-1]": (-1.0, 1.0)}, **scales)
    return ReadyPiece(Feedback(list(terms), states, "y"), {"x": x, "y": y})


@pytest.mark.parametrize("scaled", [False, True])
@pytest.mark.parametrize("horizon", [None, 8, 50])
def test_derivatives_of_a_run_are_those_of_central_differences(scaled, horizon):
    rng = np.random.default_rng(0)
    ready = course(TERMS, NAMES, rng.uniform(-1, 1, 200), rng.uniform(-1, 1, 200), scaled)
    theta, h = np.array(list(TERMS.values())), 1e-6
    found = sensitivities(ready, ready.run(theta, 0.1, WIDE, horizon), theta)
    for place in range(len(theta) + 1):
        move = h * np.eye(len(theta) + 1)[place]
        above, below = (
            ready.run(theta + sign * move[:-1], 0.1 + sign * move[-1], WIDE, horizon).output
            for sign in (1, -1)
        )
        difference = (above - below) / (2 * h)
        np.testing.assert_allclose(
            found[:, place], difference, atol=1e-5 * np.abs(difference).max()
        )


def test_runs_that_begin_anew_follow_the_measured_output():
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-1, 1, (2, 60))
    states = state_set(*NAMES, ranges={"y[k-1]": (-1.0, 1.0)})
    model = memory_model(list(TERMS), list(TERMS.values()), states, constant=0.1, limits=WIDE)
    ahead = course(TERMS, NAMES, x, y)
    run = ahead.run(model.theta, 0.1, WIDE, horizon=1)
    np.testing.assert_allclose(
        run.output,
        Along(model, ahead=True)({"x": x, "y": y}).values[ahead.start :],
        rtol=1e-12,
        atol=1e-12,
    )
    free = ahead.run(model.theta, 0.1, WIDE)
    np.testing.assert_allclose(
        free.output, Along(model)({"x": x, "y": y}).values[ahead.start :], rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("horizon", [1, 4, 5])
def test_a_run_begins_anew_where_all_that_it_recalls_is_known(horizon):
    """At multiples of the horizon, counted from the first sample that has a history, unless one of
    the two samples before is missing there.
    """
    x, y = np.random.default_rng(2).uniform(-1, 1, (2, 40))
    y[[9, 21, 30]] = np.nan
    ready = course(["x", "y[k-2]"], ["x", "y[k-2]"], x, y)
    expected, begin = [], 0
    for k in range(38):
        if k % horizon == 0 and np.isfinite(y[k : k + 2]).all():  # rows k + 2 - 2 and k + 2 - 1
            begin = k
        expected.append(begin)
    assert (ready.start, ready.begins(horizon).tolist()) == (2, expected)
    assert ready.begins(None).tolist() == [0] * 38
    run = ready.run(np.array([0.5, 0.8]), 0.0, WIDE, horizon)
    back = np.arange(38) - 2  # measured before its stretch, else simulated
    measured = back < expected
    past = np.where(measured, y[:38], run.output[np.maximum(back, 0)])
    (recalled,) = ready.recalled(run).values()
    np.testing.assert_array_equal(recalled, past)


def logistic():
    """An input through a slow lag; the dictionary below also has terms that explode."""
    rng = np.random.default_rng(2)
    x = wandering(400, seed=2)
    y = np.zeros(400)
    for k in range(1, 400):
        y[k] = 0.95 * y[k - 1] + 0.05 * x[k - 1]
    return record(x=x, y=y + 0.05 * rng.normal(size=400))


def test_a_start_that_explodes_is_tamed_by_short_horizons():
    """One that explodes at once has an infinite error."""
    given = logistic().columns
    ready = course(["y[k-1]", "x[k-1]"], ("y[k-1]", "x[k-1]"), given["x"], given["y"])
    one = FreeRunProblem(
        lambda _numbers: (ready,),
        (np.ones(ready.size, dtype=bool),),
        (-100.0, 100.0),
        np.zeros(2),
        False,
        np.array([[-np.inf] * 3, [np.inf] * 3]),
    )
    assert np.isinf(refine(one, np.array([1e6, 0.0, 0.0])).error)
    start = np.array([1.1, 0.05, 0.0])
    assert np.isinf(minimise(one, start, None, THOROUGH).error)
    np.testing.assert_allclose(refine(one, start).vector[:2], [0.95, 0.05], atol=0.01)


def test_an_error_is_that_of_the_samples_that_count_and_the_penalty():
    """Within the bounds of the coefficients; of a run that leaves the limits it is infinite."""
    x, y = np.random.default_rng(3).uniform(-1, 1, (2, 30))
    ready = course(["y[k-1]", "x"], ("y[k-1]", "x"), x, y)
    counted, ridge = np.arange(29) % 3 > 0, np.array([2.0, 0.5])
    between = np.array([[-0.5, -9.0, -9.0], [0.5, 9.0, 9.0]])
    problem = FreeRunProblem(lambda _: (ready,), (counted,), (-5.0, 5.0), ridge, True, between)
    run = [y[0]]
    for k in range(1, 30):
        run.append(0.5 * run[-1] + 0.8 * x[k] + 0.1)
    left = (y - run)[1:][counted]
    found = problem.at(np.array([0.7, 0.8, 0.1]))
    assert found.vector.tolist() == [0.5, 0.8, 0.1]
    np.testing.assert_allclose(found.residuals, left)
    assert found.error == pytest.approx(left @ left + 2 * 0.5**2 + 0.5 * 0.8**2)
    assert problem.at(np.array([0.5, 0.8, 6.0])).error == np.inf
    for count in (3, 4):  # of three parameters, three samples leave no error to estimate
        few = replace(problem, counted=(np.arange(29) < count,))
        assert np.isfinite(free_run_errors(few, np.array([0.4, 0.8, 0.1]))[0]).all() == (count > 3)


def test_states_are_scaled_by_their_training_range():
    states = state_set("x", "y[k-1]", low=[-1.0, 3.0], high=[3.0, 3.0])
    scaling = memory_model(["x"], [1.0], states, constant=0.5, limits=(0.0, 1.0)).scaling
    assert (scaling.rule, scaling.slope.tolist()) == ("range", [0.25, 0.0])
    assert (scaling.intercept.tolist(), scaling.y_slope, scaling.y_intercept) == ([0.25, 0], 1, 0.5)
    plain = memory_model(["x"], [1.0], state_set("x", "y[k-1]"), limits=(0.0, 1.0)).scaling
    assert (plain.rule, plain.slope.tolist()) == ("none", [1, 1])
    assert plain.intercept.tolist() == [0, 0]


DICTIONARY = ("y[k-1]", "x[k-1]", "y[k-1]^2", "y[k-1]^3", "x[k-1]*y[k-1]", "x[k-1]^2")
RUNNING = {"criterion": "free_run", "stop": "free_run"}


def test_no_model_that_stays_finite_is_an_error():
    """The output doubles from sample to sample in the training data, and its models with it."""
    y = 2.0 ** np.arange(40)
    with pytest.raises(DataError, match="every candidate model diverges if it gets its own"):
        fit_with_memory(
            [record(x=np.zeros(40), y=y)], recipe_of("y", ["y[k-1]"], max_terms=1, **RUNNING)
        )


@pytest.mark.parametrize("ridge", [0.0, 1e-5])
def test_the_held_out_end_decides_on_the_number_of_terms(ridge):
    """The error there of every size is told, and is that of the models fitted to the beginning
    alone.
    """
    given = logistic()
    fit = fit_with_memory(
        [given],
        recipe_of("y", DICTIONARY, max_terms=4, ridge=ridge, **RUNNING),
    )
    assert len(fit.model.terms) == int(np.argmin(fit.held_out)) + 1
    assert fit.selection.stop == "free_run"
    beginning = record(np.arange(400) < 300, **given.columns)
    alone = fit_with_memory(
        [beginning],
        recipe_of(
            "y", fit.model.terms, max_terms=len(fit.model.terms), ridge=ridge, criterion="free_run"
        ),
    )
    run = Along(alone.model)(given.columns).values
    assert fit.held_out.min() == pytest.approx(
        np.sqrt(np.mean((run - given.columns["y"])[300:] ** 2)), rel=0.02
    )


def test_progress_is_told_for_every_size():
    told = []
    recipe = recipe_of("y", DICTIONARY, max_terms=3, **RUNNING)
    fit_with_memory([logistic()], recipe, lambda done, total: told.append((done, total)))
    assert told == [(1, 3), (2, 3), (3, 3)]
