"""Simulation from the first measured outputs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from memory_samples import STEP, memory_model, narx_truth, state_set

from mapmore_cli.modelling.memory.free_run import Along, _refuse_other_steps
from mapmore_cli.modelling.memory.records import AtSample
from mapmore_cli.modelling.memory.simulation import divergence_bounds

LAGS = state_set("x[k-1]", "x[k-2]", "y[k-1]", "y[k-2]")
TRUTH = memory_model(["x[k-2]", "y[k-2]", "x[k-1]*y[k-1]", "y[k-1]^2"], [0.6, -0.5, 0.7, 0.2], LAGS)


def test_a_noise_free_record_is_repeated_from_its_first_two_outputs():
    x = np.random.default_rng(0).uniform(-1, 1, 500)
    y = narx_truth(x, 0.3, -0.2)
    run = Along(TRUTH)({"x": x, "y": y})
    assert np.isnan(run.values[:2]).all()
    for values in (run.values, Along(TRUTH, ahead=True)({"x": x, "y": y}).values):
        np.testing.assert_allclose(values[2:], y[2:], rtol=1e-12, atol=1e-12)
    assert run.diverged == ()


def test_only_the_sample_after_the_first_outputs_has_a_measured_past():
    x = np.random.default_rng(0).uniform(-1, 1, 200)
    known = np.where(np.arange(200) < 2, narx_truth(x), np.nan)
    assert np.isfinite(Along(TRUTH, ahead=True)({"x": x, "y": known}).values).sum() == 1
    assert np.isfinite(Along(TRUTH)({"x": x, "y": known}).values).sum() == 198


WITH_MEMORY = ("x[k-3]", "y[k-1]", "slow(x, 0.3)", "play(x, 0.1)", "stop(x, 0.1)", "rate(x)")
WITH_MEMORY += ("resonance(x, 4, 0.2)", "direction(x)", "creep(x, 0.5, 0.05)", "slow(y[k-1], 0.1)")


TERMS = {
    "x": lambda s: s["x"],
    "y[k-1]": lambda s: s["y[k-1]"],
    "y[k-1]*y[k-2]": lambda s: s["y[k-1]"] * s["y[k-2]"],
    "x*y[k-1]^2": lambda s: s["x"] * s["y[k-1]"] ** 2,
    "y[k-1]*y[k-2]*y[k-3]": lambda s: s["y[k-1]"] * s["y[k-2]"] * s["y[k-3]"],
    "x[k-4]^2*y[k-3]": lambda s: s["x[k-4]"] ** 2 * s["y[k-3]"],
    "1": lambda _: 1.0,
    "x*y[k-1]^3": lambda s: s["x"] * s["y[k-1]"] ** 3,
    "x*exp(-y[k-1])": lambda s: s["x"] * np.exp(-s["y[k-1]"]),
    "y[k-3]^2/2": lambda s: s["y[k-3]"] ** 2 / 2,
}
NAMES = ("x", "x[k-4]", "y[k-1]", "y[k-2]", "y[k-3]")


def reference(model, x, y, scale):
    """The same model, sample by sample and term by term."""
    values = y[:4].tolist()
    for k in range(4, len(x)):
        now = dict(zip(NAMES, (x[k], x[k - 4], *values[:-4:-1]), strict=True))
        states = {name: scale(now[name], place) for place, name in enumerate(NAMES)}
        values.append(
            model.constant
            + sum(
                theta * TERMS[term](states)
                for term, theta in zip(model.terms, model.theta, strict=True)
            )
        )
    return np.array(values)


@given(
    st.lists(st.sampled_from(sorted(TERMS)), min_size=1, max_size=6, unique=True),
    st.integers(0, 1000),
    st.booleans(),
    st.floats(0.0, 0.5),
)
def test_any_model_runs_as_written(terms, seed, scaled, margin):
    rng = np.random.default_rng(seed)
    low, high = rng.uniform(-2, -0.5, 5), rng.uniform(0.5, 2, 5)
    states = state_set(*NAMES, low=low, high=high, margin=margin) if scaled else state_set(*NAMES)
    model = memory_model(
        terms, rng.uniform(-0.5, 0.5, len(terms)), states, constant=rng.normal(), limits=(-1e9, 1e9)
    )
    x, y = rng.uniform(-1, 1, 40), rng.uniform(-1, 1, 40)

    def scale(value, place):
        return (
            np.clip((value - low[place]) / (high[place] - low[place]), -margin, 1 + margin)
            if scaled
            else value
        )

    with np.errstate(all="ignore"):
        expected = reference(model, x, y, scale)
    run = Along(model)({"x": x, "y": y})
    end = run.diverged[0] if run.diverged else 40
    np.testing.assert_allclose(run.values[4:end], expected[4:end], rtol=1e-6, atol=1e-9)
    assert np.isnan(run.values[:4]).all()
    assert end == 40 or not abs(expected[end]) < 1e11


def test_a_past_output_that_never_changed_in_training_has_no_influence():
    states = state_set("x", "y[k-1]", low=[0, 0.5], high=[1, 0.5])
    x = np.random.default_rng(0).uniform(0, 1, 9)
    run = Along(memory_model(["y[k-1]", "x"], [3.0, 2.0], states))({"x": x, "y": np.ones(9)})
    np.testing.assert_allclose(run.values[1:], 2 * x[1:])


@pytest.mark.parametrize("term", ["y[k-1]^20", "exp(y[k-1])", "log(-y[k-1])", "1/(y[k-1] - 1)"])
def test_overflow_and_undefined_values_are_divergence_without_a_warning(term):
    model = memory_model([term], [10.0], state_set("y[k-1]"), limits=(0.0, 1e307))
    run = Along(model)({"y": np.full(30, 1.0)})
    assert len(run.diverged) == 1
    assert run.diverged[0] < 30


def test_every_piece_diverges_by_itself():
    explosive = memory_model(["y[k-1]"], [3.0], state_set("y[k-1]"), limits=(0.0, 1.0))
    time = np.arange(300) * STEP + np.where(np.arange(300) >= 120, 0.5, 0.0)
    run = Along(explosive)({"y": np.ones(300), "time": time})
    assert run.diverged == (5, 125)  # 243 is more than a hundred ranges beyond 0..1
    assert run.values[1:5].tolist() == run.values[121:125].tolist() == [3, 9, 27, 81]
    assert np.isnan(run.values[5:121]).all()


@pytest.mark.parametrize(
    ("time", "rows", "sample"),
    [
        ([0, 2, 4, 6], [0, 1, 2, 3], 1),
        ([0, 1, 3, 5], [0, 1, 2, 3], 2),
        ([0, 1, 3], [0, 1, 2], None),  # half of the steps are longer, and may be gaps
        ([0, 2], [0, 1], None),
        ([0, 2, 4], [0, 1, 2], 1),
        ([0, 3, 6, 7, 8], [0, 2, 4, 5, 6], None),  # a row is missing between samples
        ([0, 1.0009, 2.0018], [0, 1, 2], None),
        ([0, 1.001, 2.002], [0, 1, 2], None),
    ],
)
def test_a_record_of_longer_steps_is_refused_where_most_are(time, rows, sample):
    stamps = STEP * np.array(time, dtype=float)
    if sample is None:
        _refuse_other_steps(stamps, np.array(rows), STEP)
        return
    with pytest.raises(
        AtSample, match=r"0.02 s after the previous sample, as most samples are"
    ) as told:
        _refuse_other_steps(stamps, np.array(rows), STEP)
    assert told.value.sample == sample


def test_a_run_along_longer_steps_is_refused():
    x = np.zeros(40)
    with pytest.raises(AtSample, match="as most samples are"):
        Along(TRUTH)({"time": 2 * STEP * np.arange(40), "x": x, "y": x})


def test_a_run_without_its_first_outputs_is_refused_at_the_missing_sample():
    y = np.where(np.arange(20) == 1, np.nan, 0.5)
    with pytest.raises(AtSample, match="y is missing at the start of a run") as told:
        Along(TRUTH)({"x": np.zeros(20), "y": y})
    assert told.value.sample == 1


def test_a_piece_shorter_than_its_history_has_no_prediction():
    for n in (0, 1, 2):
        run = Along(TRUTH)({"x": np.zeros(n), "y": np.zeros(n)})
        assert np.isnan(run.values).all()
        assert (len(run.values), run.diverged) == (n, ())


@pytest.mark.parametrize(
    ("limits", "size"), [((1.0, 3.0), 2.0), ((5.0, 5.0), 5.0), ((-8.0, -8.0), 8.0), ((0.0, 0.0), 1)]
)
def test_a_run_diverges_beyond_a_hundred_times_the_training_range(limits, size):
    """Of an output that never changed, beyond as many times its size, or one."""
    low, high = divergence_bounds(limits)
    assert (limits[0] - low, high - limits[1]) == pytest.approx((100 * size,) * 2)
    assert np.isfinite(divergence_bounds((-1.7e308, 1.7e308))).all()
