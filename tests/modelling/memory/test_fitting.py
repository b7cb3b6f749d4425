"""Models with memory fitted to recordings whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from memory_samples import (
    STEP,
    narx_truth,
    recipe_of,
    record,
    slow,
    texts,
    wandering,
)

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.equations import summed
from mapmore_cli.modelling.expressions import evaluate, families
from mapmore_cli.modelling.expressions.families import lags, operated
from mapmore_cli.modelling.expressions.operators.play import play
from mapmore_cli.modelling.memory import fitting, selectors, training
from mapmore_cli.modelling.memory.fitting import fit_outputs, fit_with_memory
from mapmore_cli.modelling.memory.free_run import Along
from mapmore_cli.modelling.memory.model import memory_model, outliers_fed_back
from mapmore_cli.modelling.memory.refinement import refine
from mapmore_cli.modelling.memory.training import TrainingData

NARX = texts(lags(["y", "x"], [1, 2]), 2)
LAGGED = recipe_of("y", NARX, STEP, max_terms=4)


def narx_records(noise=0.0, count=3, n=200):
    rng = np.random.default_rng(7)
    inputs = [rng.uniform(-1, 1, n) for _ in range(count)]
    return [
        record(x=x, y=narx_truth(x, *rng.uniform(-1, 1, 2)) + noise * rng.normal(size=n))
        for x in inputs
    ]


@pytest.mark.parametrize("loss", ["huber", "bisquare"])
def test_one_gross_outlier_of_a_short_record_moves_a_model_of_past_inputs_by_the_noise(loss):
    rng, noise = np.random.default_rng(20), 0.3
    x = rng.uniform(0, 1, 20)
    now, past = x[1:-1], x[:-2]
    truth = 300 * (0.5 * now + 0.3 * past + 0.4 * now * past)
    y = np.append([0.0, 0.0], truth + rng.normal(0, noise, 18))
    terms = ("x[k-1]", "x[k-2]", "x[k-1]*x[k-2]", "x[k-1]^2", "x[k-2]^2")
    products = np.stack([now, past, now * past, now**2, past**2], axis=1)
    recipe = recipe_of("y", terms, STEP, max_terms=5, loss=loss)

    def prediction(y):
        model = fit_with_memory([record(x=x, y=y)], recipe).model
        return products[:, [terms.index(term) for term in model.terms]] @ model.theta

    whole = prediction(y)
    for place in (6, 10, 18, 19):
        assert np.abs(prediction(y + 300.0 * (np.arange(20) == place)) - whole).max() < 2 * noise


def test_a_robust_model_of_past_outputs_says_that_an_outlier_can_still_change_it():
    quantities = {name: Quantity(name, "1") for name in "xy"}
    for term, count in (("y[k-1]", 1), ("x[k-1]", 0)):
        recipe = recipe_of("y", (term,), STEP, max_terms=1, loss="huber")
        model = fit_with_memory(narx_records(count=1), recipe).model
        built = memory_model("m", model, None, (), quantities)
        assert len(outliers_fed_back(built, "huber")) == count
        assert not outliers_fed_back(built, "squares")


def test_the_terms_of_a_simulated_record_are_found():
    fit = fit_with_memory(narx_records(), LAGGED)
    found = dict(zip(fit.model.terms, fit.model.theta, strict=True))
    assert found == pytest.approx(
        {"x[k-2]": 0.6, "y[k-2]": -0.5, "x[k-1]*y[k-1]": 0.7, "y[k-1]^2": 0.2}, abs=1e-9
    )
    assert fit.selection.samples == 3 * 198  # the first two of every record are history
    assert (fit.ridge, fit.model.constant, fit.model.states.names) == (
        0.0,
        0.0,
        ("x[k-1]", "x[k-2]", "y[k-1]", "y[k-2]"),
    )


def test_the_first_samples_of_a_record_are_no_history_of_the_next():
    records = narx_records(count=2)
    jumbled = record(
        **{name: np.concatenate([one.columns[name] for one in records]) for name in ("x", "y")}
    )
    assert (
        fit_with_memory(records, LAGGED).selection.sse
        < 1e-20
        < fit_with_memory([jumbled], LAGGED).selection.sse
    )


def test_samples_that_are_held_out_teach_nothing():
    one, other = narx_records(count=2)
    spoilt = replace(
        other, columns={**other.columns, "y": np.full(200, 1e6)}, training=np.zeros(200, dtype=bool)
    )
    np.testing.assert_array_equal(
        fit_with_memory([one, spoilt], LAGGED).model.theta,
        fit_with_memory([one], LAGGED).model.theta,
    )


@pytest.mark.parametrize("stop", ["bic", "free_run"])
@pytest.mark.parametrize("ridge", [0.0, 1e-6])
def test_stop_rules_find_the_number_of_terms(stop, ridge):
    recipe = replace(LAGGED, max_terms=10, stop=stop, ridge=ridge)
    fit = fit_with_memory(narx_records(noise=1e-3), recipe)
    assert {"x[k-2]", "y[k-2]", "x[k-1]*y[k-1]", "y[k-1]^2"} <= set(fit.model.terms)
    assert len(fit.model.terms) == 4


def hysteretic(n, seed):
    x = wandering(n, seed)
    return x, 3 * slow(x, 0.2, STEP) ** 2 - 2 * play(x, 0.8) + x + 5


LAGS, WIDTHS = [(0.05,), (0.2,), (1,)], [(0.1,), (0.2,), (0.4,)]
STATES = ("x", *operated("slow", ["x"], LAGS), *operated("play", ["x"], WIDTHS))
OPERATED = recipe_of(
    "y",
    texts(STATES, 2, partners=["x"], constant=False),
    STEP,
    scaling="range",
    ridge=1e-6,
    max_terms=4,
)


def hysteretic_fit(n=2000, **changed):
    x, y = hysteretic(n, 1)
    return x, y, fit_with_memory([record(x=x, y=y)], replace(OPERATED, **changed))


def test_pruned_terms_leave_their_traces():
    x, y, fit = hysteretic_fit(forward=9)
    assert len(fit.forward) == 9
    assert set(fit.selection.chosen) <= set(fit.forward)
    assert fit.model.terms == tuple(fit.candidates[i] for i in fit.selection.chosen)
    assert fit.selection.stop == "pruned"
    residual = y - Along(fit.model)({"x": x}).values
    assert fit.selection.sse == pytest.approx(residual @ residual, rel=1e-6)
    assert fit.selection.yy == pytest.approx(np.sum((y - y.mean()) ** 2))
    assert residual.mean() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("scaling", ["range", "none"])
def test_the_equation_is_the_model(scaling):
    x, _, fit = hysteretic_fit(500, scaling=scaling)
    columns = {"x": x} | {f"slow(x, {tau:g})": slow(x, tau, STEP) for tau in (0.05, 0.2, 1)}
    columns |= {f"play(x, {width:g})": play(x, width * np.ptp(x)) for width in (0.1, 0.2, 0.4)}
    whole, where = summed(fit.model.terms, fit.model.theta, fit.model.scaling, {})
    columns |= {short: evaluate(line, columns) for short, line in where.items()}
    np.testing.assert_allclose(
        evaluate(whole, columns), Along(fit.model)({"x": x}).values, rtol=1e-8
    )


def test_the_ridge_may_be_left_to_the_data():
    x, y, weak = hysteretic_fit(ridge="auto")
    strong = fit_with_memory(
        [record(x=x[:300], y=y[:300] + np.random.default_rng(0).normal(0, 30, 300))],
        replace(OPERATED, ridge="auto"),
    )
    assert weak.ridge < strong.ridge


@pytest.mark.parametrize(("n", "sizes"), [(21, [5, 5, 5, 6]), (3, [1, 1, 1])])
def test_the_ridge_is_chosen_with_four_blocks_of_samples_if_there_are_as_many(
    n, sizes, monkeypatch
):
    seen = []

    def choose(_total, folds, *_):
        seen.extend(fold.samples for fold in folds)
        return 0.1

    monkeypatch.setattr(selectors, "choose_ridge", choose)
    x = wandering(n)
    TrainingData([record(x=x, y=3 * x)], recipe_of("y", ("x",), max_terms=1, ridge="auto"))
    assert seen == sizes


def test_starting_values_are_compared_on_the_first_training_samples(monkeypatch):
    """And the last search begins at those with the smallest error."""
    seen, starts, errors = [], [], iter((3.0, 1.0, 2.0))

    def refined(problem, start):
        seen.append(sum(int(rows.sum()) for rows in problem.counted))
        starts.append(start[-1])
        found = refine(problem, start)
        error = next(errors, found.error)
        return found._replace(error=error, vector=np.append(found.vector[:-1], -error))

    monkeypatch.setattr(fitting, "refine", refined)
    monkeypatch.setattr(fitting, "SHORT", 60)
    inputs = [wandering(50, seed) for seed in range(2)]
    records = [record(np.arange(50) >= 10, x=x, y=slow(x, 0.1, STEP)) for x in inputs]
    fit = fit_with_memory(records, recipe_of("y", ("slow(x)",), max_terms=1))
    assert seen == [60, 60, 60, 80]  # three sets of starting values, then all samples
    assert starts[-1] == -1.0
    assert len(fit.identified.numbers) == 1


@pytest.mark.parametrize("recipe", [LAGGED, replace(LAGGED, ridge=1e-4)])
def test_a_dictionary_beyond_memory_is_built_block_by_block(recipe, monkeypatch):
    records = narx_records(noise=0.01, n=5000)
    whole = fit_with_memory(records, recipe)
    monkeypatch.setattr(families, "usable_memory", lambda: families.products_bytes(len(NARX)))
    blocks = fit_with_memory(records, recipe)
    assert blocks.model.terms == whole.model.terms
    np.testing.assert_allclose(blocks.model.theta, whole.model.theta, rtol=1e-9)
    monkeypatch.setattr(families, "usable_memory", lambda: families.products_bytes(len(NARX)) - 1)
    with pytest.raises(DataError, match="a dictionary with 15 candidates need"):
        fit_with_memory(records, recipe)


@pytest.mark.parametrize(
    ("samples", "recipe", "told"),
    [
        (5, LAGGED, r"3 training sample\(s\) have enough samples .* too few for 4 term"),
        (6, LAGGED, r"4 training sample\(s\) have enough samples .* too few for 4 term"),
        (2, LAGGED, "no training sample has as many samples before it"),
        (100, replace(OPERATED, target="still"), "no candidate term explains any part"),
        (100, replace(LAGGED, target="z"), "no column `z`"),
        *(
            (
                100,
                replace(LAGGED, dictionary=(text,), max_terms=1),
                "uses the present value of the output y",
            )
            for text in ("y", "slow(y, 1)", "play(y, 0.1)[k-1]")
        ),
        (
            100,
            replace(LAGGED, dictionary=("x[k-1]", "exp(x*y[k-1])"), max_terms=1),
            "mixes delayed outputs and inputs",
        ),
    ],
)
def test_what_cannot_be_fitted_is_refused_with_what_to_do(samples, recipe, told):
    x, y = (values[:samples] for values in hysteretic(100, 1))
    with pytest.raises(DataError, match=told):
        fit_with_memory([record(x=x, y=y, still=np.full(samples, 3.0))], recipe)


def test_errors_of_a_regularised_fit_are_those_of_its_normal_equations():
    """Of records too short to say that neighbours err together: `N^-1 P'P N^-1 s^2`, N = P'P + the
    ridge times every candidate's squares about its mean, of P about its mean.
    """
    rng, ridge = np.random.default_rng(3), 0.05
    P, noise = 2.0 + rng.normal(size=(60, 2)), 0.1 * rng.normal(size=60)
    y = P @ [1.5, -0.8] + 3.0 + noise
    parts = [slice(start, start + 15) for start in range(0, 60, 15)]
    records = [record(x=P[part, 0], w=P[part, 1], y=y[part]) for part in parts]
    fit = fit_with_memory(records, recipe_of("y", ("x", "w"), STEP, max_terms=2, ridge=ridge))
    centred = P - P.mean(axis=0)
    normal = centred.T @ centred + ridge * np.diag(np.sum(centred**2, axis=0))
    theta = np.linalg.solve(normal, centred.T @ (y - y.mean()))
    order = [fit.model.terms.index(name) for name in ("x", "w")]
    assert fit.model.theta[order] == pytest.approx(theta)
    left = y - y.mean() - centred @ theta
    spread = np.linalg.solve(normal, centred.T)
    errors = np.sqrt(np.diag(spread @ spread.T) * (left @ left) / (60 - 2))
    assert fit.model.theta_error[order] == pytest.approx(errors, rel=1e-9)


def test_open_parameters_are_variables_of_a_problem_that_searches_them():
    x = wandering(50)
    data = TrainingData([record(x=x, y=x)], recipe_of("y", ("slow(x)", "x"), max_terms=1), (0.1,))
    chosen = np.array([0, 1])
    assert data.problem(chosen).between.shape == (2, 3)  # two coefficients and the constant
    assert data.problem(chosen, search=True).between.shape == (2, 4)


@pytest.mark.parametrize("beyond", [False, True])
def test_errors_of_more_values_than_a_limit_assume_independent_samples(beyond, monkeypatch):
    x = wandering(60)
    monkeypatch.setattr(training, "MOST", 60 - beyond)
    data = TrainingData(
        [record(x=x, y=x + 0.1 * wandering(60, 1))], recipe_of("y", ("x",), max_terms=1)
    )
    assert np.isnan(data.fit(data.selector.best()).selection.worth) == beyond


def test_a_free_run_ends_with_the_last_sample_that_counts():
    """What comes after is simulated for nothing, and may even let the run diverge."""
    (one,) = narx_records(count=1)
    beginning = replace(one, training=np.arange(200) < 60)
    data = TrainingData([beginning, replace(one, training=np.zeros(200, dtype=bool))], LAGGED)
    problem = data.problem(np.array([0, 1]))
    (piece,) = problem.pieces(np.empty(0))
    assert (piece.start + piece.size, problem.counted[0].tolist()) == (
        60,
        [True] * (60 - piece.start),
    )


def test_outputs_share_their_terms():
    """`y` and `w` have other coefficients of the terms that explain both best."""
    rng = np.random.default_rng(1)
    x, z, u = rng.normal(size=(3, 90))
    columns = {"x": x, "z": z, "u": u, "y": 3 * x + z, "w": z - x + 0.1 * u}
    recipes = [recipe_of(target, ("u", "x", "z"), STEP, max_terms=2) for target in "yw"]
    first, second = fit_outputs([record(**columns)], recipes)
    assert {*first.model.terms} == {"x", "z"}
    assert {*second.model.terms} == {"x", "z"}
    assert (first.model.output, second.model.output) == ("y", "w")
    for fit in (first, second):
        P = np.column_stack([columns[name] for name in fit.model.terms])
        expected = np.linalg.lstsq(P, columns[fit.model.output])[0]
        assert fit.model.theta == pytest.approx(expected)
    free = [replace(recipe, dictionary=("slow(x)",), max_terms=1) for recipe in recipes]
    with pytest.raises(DataError, match="for one target only, and this spec has y, w"):
        fit_outputs([record(**columns)], free)
