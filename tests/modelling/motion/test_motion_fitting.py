"""Fitting: what made the data comes back, by every solver from declared bounds; hostile records."""

from dataclasses import replace

import numpy as np
import pytest
from motion_samples import (
    BOUNDARIES,
    ROWS,
    STEP,
    coefficients,
    looped,
    made_by,
    published,
    recipe,
    record,
    sine,
)
from motion_tables import continued

from mapmore_cli.annexes.motion import solvers
from mapmore_cli.annexes.motion.body import BUMPLESS
from mapmore_cli.annexes.motion.fitting import fit_motion
from mapmore_cli.annexes.motion.problem import Bounds, Piece, Problem
from mapmore_cli.annexes.motion.simulation import simulate, stable
from mapmore_cli.annexes.motion.solvers import SOLVERS, STRIDES, fly, linear_start
from mapmore_cli.domain.declared import Contradiction
from mapmore_cli.domain.errors import DataError, FitError

NOISE = 0.05


def one(records, **settings):
    fit = fit_motion(records, recipe(**settings))
    return fit.model.sections[0], fit.searches[0]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['model']}-{row['printed_section']}")
def test_least_squares_recovers_every_published_row(row):
    section, search = one([made_by(row)])
    assert [section.p1, section.p2, section.p3] == pytest.approx(coefficients(row), abs=1e-6)
    assert search.rmse < 1e-9


def test_the_published_swarm_does_not_settle():
    """Outside of the region in which swarms settle (its W, C1 and C2), with 20 iterations: whatever
    the seed, the error stays above twice that of least squares.
    """
    records = [made_by(ROWS[0], 400, NOISE)]
    least = one(records)[1].rmse
    assert min(one(records, seed=seed, solver="swarm")[1].rmse for seed in range(10)) > 2 * least


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_tells_its_way(solver):
    records = [made_by(ROWS[0], 200, NOISE)]
    section, search = one(records, solver=solver, seed=3)
    again, _ = one(records, solver=solver, seed=3)
    assert (section.p1, section.p2, section.p3) == (again.p1, again.p2, again.p3)
    assert stable(section.p1, section.p2)
    assert search.samples == 200
    assert np.all(np.diff(search.history) <= 0)
    assert search.history[-1] == pytest.approx(search.rmse, rel=1e-9)
    if solver.startswith("swarm"):
        assert len(search.history) == 21


def test_every_seed_and_every_section_draws_numbers_of_its_own():
    """The same record in each section: one seed for all would find the same parameters twice."""
    u = np.concatenate([sine(200), sine(200)])
    records = [record(u, simulate(published("linear"), {"input": u}))]
    asked = [recipe(direction=True, solver="swarm", seed=seed) for seed in (1, 2)]
    begun = {search.history[0] for one in asked for search in fit_motion(records, one).searches}
    assert len(begun) == 4


def test_the_displacement_says_which_samples_rise():
    """The output moves against the input: its rise is the input's fall."""
    u = sine(400)
    y = -u
    by = {
        mask: fit_motion([record(u, y)], recipe(direction=True, mask=mask)).searches[0].samples
        for mask in ("input", "displacement")
    }
    assert by["input"] == int(np.sum(np.diff(u, prepend=u[0]) > 0))
    assert by["displacement"] == int(np.sum(np.diff(y, prepend=y[0]) > 0))


@pytest.mark.parametrize("begin", [None, np.array([[0.0, 0.0], [0.5, 0.5]])])
def test_a_swarm_finds_the_bottom_of_a_bowl_from_its_box_and_may_leave_it(begin):
    seen = []
    walls, bottom = np.array([[-1.0, -1.0], [1.0, 1.0]]), np.array([-0.6, -0.4])
    best, history = fly(
        lambda x: (seen.append(x.copy()), float(np.sum((x - bottom) ** 2)))[1],
        walls,
        np.random.default_rng(2),
        begin,
    )
    low, high = walls if begin is None else begin
    assert np.all((np.array(seen[:50]) >= low) & (np.array(seen[:50]) <= high))
    assert history[-1] == min(history) == pytest.approx(np.sum((best - bottom) ** 2))
    assert history[-1] < 0.01


def test_a_swarm_moves_as_published(monkeypatch):
    """Three particles, three times: `v = 0.9 v + 2 r1 (own best - x) + 2 r2 (common best - x)`."""
    monkeypatch.setattr(solvers, "PARTICLES", 3)
    monkeypatch.setattr(solvers, "ITERATIONS", 3)
    walls, seen = np.array([[-1.0, -1.0], [1.0, 1.0]]), []

    def cost(x):
        return float(np.sum((x - 0.2) ** 2))

    fly(lambda x: (seen.append(x.copy()), cost(x))[1], walls, np.random.default_rng(7))
    rng = np.random.default_rng(7)
    x, v = -1 + 2 * rng.random((3, 2)), np.zeros((3, 2))
    own, expected = x.copy(), [*x]
    for _ in range(3):
        common = min(own, key=cost).copy()
        r1, r2 = rng.random((3, 2)), rng.random((3, 2))
        v = 0.9 * v + 2 * r1 * (own - x) + 2 * r2 * (common - x)
        stopped = np.abs(x + v) > 1
        x, v = np.clip(x + v, -1, 1), np.where(stopped, 0, v)
        own = np.array([min(pair, key=cost) for pair in zip(own, x, strict=True)])
        expected += [*x]
    np.testing.assert_allclose(seen, expected)


def piece_of(y, counts=None, **drives):
    counts = np.ones(len(y), dtype=bool) if counts is None else counts
    columns = drives or {"input": np.zeros(len(y))}
    return Piece(np.column_stack([*columns.values()]), y, counts, np.zeros(len(y), dtype=int))


@pytest.mark.parametrize("stride", STRIDES)
def test_a_linear_start_has_the_poles_of_a_free_decay(stride):
    """Poles .97 and .9, from samples of two pieces that count, three of them a stride apart."""
    k = np.arange(160)
    decays = [3 * 0.97**k - 2 * 0.9**k, 0.97**k + 4 * 0.9**k]
    counts = k >= 70
    decays[1] = np.where(counts, decays[1], 1e6)
    pieces = (piece_of(decays[0]), piece_of(decays[1], counts), piece_of(decays[0][: 2 * stride]))
    assert linear_start(pieces, stride) == pytest.approx((-0.97 * 0.9, 0.97 + 0.9), rel=1e-6)
    three, two = (piece_of(decays[0][: 2 * stride + count]) for count in (3, 2))
    assert linear_start((three,), stride) is not None
    assert (linear_start((two,), stride) is None) == (stride > 1)
    assert linear_start((piece_of(k[:2] * 1.0),), 1) == (0.0, 0.0)


def test_a_swarm_begins_in_the_declared_ranges_and_stays_among_stable_sections(monkeypatch):
    """P3 reaches to four times the ratio of the spans of output and input, of all pieces."""
    rng = np.random.default_rng(1)
    u, y = rng.random(60) * 2, rng.random(60)
    u[[3, 50]], y[[7, 40]] = (-1.0, 9.0), (-2.0, 3.0)  # spans of 10 and 5
    problem = Problem([piece_of(y[:30], input=u[:30]), piece_of(y[30:], input=u[30:])])
    boxes = []

    def flown(cost, walls, rng, begin):
        boxes.append((walls.tolist(), begin if begin is None else begin.tolist()))
        at = np.array([0.2, 0.3, -0.4])
        return at, [5.0, cost(at)]

    monkeypatch.setattr(solvers, "fly", flown)
    whole = [[-1.0, -2.0, -2.0], [1.0, 2.0, 2.0]]
    found = solvers.swarm(problem, recipe())
    solvers.swarm(problem, recipe(begin=Bounds(p1=(0.1, 0.2), p3=(0.0, 7.0))))
    solvers.swarm(problem, recipe(begin=Bounds(p2=(0.1, 0.2))))
    assert boxes == [
        (whole, None),
        (whole, [[0.1, -2.0, 0.0], [0.2, 2.0, 7.0]]),
        (whole, [[-1.0, 0.1, -2.0], [1.0, 0.2, 2.0]]),
    ]
    left = [looped(u[rows], (0.2, 0.3, -0.4)) - y[rows] for rows in (slice(30), slice(30, 60))]
    assert found.rmse == pytest.approx(np.sqrt(np.mean(np.concatenate(left) ** 2)))
    assert (found.p1, found.p2, *found.weights, found.evaluations) == (0.2, 0.3, -0.4, 1)
    monkeypatch.setattr(solvers, "fly", lambda *_: (np.array([0.9, 0.3, 1.0]), [1.0]))
    with pytest.raises(FitError, match="no stable parameters"):
        solvers.swarm(problem, recipe())


@pytest.mark.parametrize("count", [1, 3])
def test_the_error_of_poles_is_that_of_the_best_weights_of_their_drives(count):
    """Weights follow by least squares; the error of an unstable section grows with its pole."""
    rng = np.random.default_rng(count)
    drives = rng.normal(size=(50, count))
    y, counts = rng.normal(size=50), rng.random(50) > 0.3
    each = {f"d{number}": drive for number, drive in enumerate(drives.T)}
    problem = Problem([piece_of(y, counts, **each), piece_of(y, np.ones(50, dtype=bool), **each)])
    moved = np.column_stack([looped(drive, (0.5, -0.3, 1.0)) for drive in drives.T])
    rows, wanted = np.concatenate([moved[counts], moved]), np.concatenate([y[counts], y])
    weights = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    found = problem.found(0.5, -0.3, [4.0, 5.0, 3.0])
    np.testing.assert_allclose(found.weights, weights)
    left = np.sqrt(np.mean((rows @ weights - wanted) ** 2))
    assert found.rmse == pytest.approx(left) == problem.rmse(0.5, -0.3)
    assert (found.evaluations, found.history.tolist()) == (1, [4.0, 4.0, 3.0])
    other = np.sqrt(np.mean((rows @ (2 * weights) - wanted) ** 2))
    assert problem.rmse(0.5, -0.3, 2 * weights) == pytest.approx(other)
    size = np.sqrt(np.mean(wanted**2))
    assert problem.rmse(0.0, 1.5) == pytest.approx(1500 * size)
    assert problem.rmse(0.0, 1.5, weights) == pytest.approx(1500 * size)
    none = Problem([piece_of(np.zeros(5))])
    assert (none.rmse(0.0, 0.5), none.rmse(0.0, 3.0)) == (0.0, 3000.0)
    assert Problem([piece_of(y, np.zeros(50, dtype=bool)), piece_of(y)]).y.tolist() == y.tolist()


def test_bounds_have_a_width():
    assert Bounds(p1=(0.1, 0.2)).p1 == (0.1, 0.2)
    for ends in ((0.2, 0.2), (0.3, 0.2)):
        with pytest.raises(Contradiction, match="`p1`: the lower bound"):
            Bounds(p1=ends)


def two_sines(samples):
    return np.concatenate([sine(samples), sine(samples, 0.7, 4.9, 0.4)])


@pytest.mark.parametrize("model", ["inflate_deflate", "piecewise", "piecewise_inflate_deflate"])
def test_hard_sections_come_back_from_what_they_made(model):
    truth, u, counts = published(model), two_sines(480), []
    fit = fit_motion(
        [record(u, simulate(truth, {"input": u}))],
        recipe(sections=truth.boundaries, direction=truth.directed, slowest=5.0),
        lambda done, total: counts.append((done, total)),
    )
    total = len(truth.sections)
    assert counts == [(number, total) for number in range(1, total + 1)]
    for ours, theirs in zip(fit.model.sections, truth.sections, strict=True):
        assert ours.id == theirs.id
        assert (ours.p1, ours.p2, ours.p3) == pytest.approx(
            (theirs.p1, theirs.p2, theirs.p3), abs=1e-5
        )


@pytest.mark.parametrize("directed", [False, True])
def test_sections_that_share_a_state_come_back(directed):
    """From a model whose sections meet, with offsets."""
    u = two_sines(160)
    y = simulate(
        continued(published("piecewise_inflate_deflate" if directed else "piecewise")), {"input": u}
    )
    fit = fit_motion(
        [record(u, y)],
        recipe(sections=BOUNDARIES, direction=directed, switching=BUMPLESS, slowest=5.0),
    )
    assert np.sqrt(np.mean((simulate(fit.model, {"input": u}) - y) ** 2)) < 0.02 * np.ptp(y)


def test_joined_sections_agree_at_every_boundary():
    u, boundaries = two_sines(320), BOUNDARIES[1::2]
    y = simulate(published("piecewise_inflate_deflate"), {"input": u})
    model = fit_motion(
        [record(u, y)], recipe(sections=boundaries, direction=True, switching=BUMPLESS)
    ).model

    def steady(section, level):
        return section.weights @ [level, 1.0] / (1 - section.p1 - section.p2)

    for place, edge in enumerate(boundaries):
        for way in (0, 1):
            below, above = model.sections[2 * place + way], model.sections[2 * place + 2 + way]
            assert steady(below, edge) == pytest.approx(steady(above, edge), abs=1e-9)


@pytest.mark.parametrize("switching", ["hard", BUMPLESS])
def test_what_depends_on_the_load_comes_back(switching):
    rng = np.random.default_rng(4)
    u = sine(600)
    load = np.repeat(rng.uniform(0, 50, 6), 100)
    weights = np.array([0.52, 0.1, -0.004, -0.002])
    drive = np.column_stack([u, np.ones(600), load, u * load]) @ weights
    y = looped(drive, (0.45, 0.3, 1.0))
    one_record = replace(record(u, y), columns={**record(u, y).columns, "load": load})
    fit = fit_motion([one_record], recipe(load="load", switching=switching))
    assert fit.model.drives == ("input", "1", "load", "input*load")
    assert fit.model.sections[0].weights == pytest.approx(weights, rel=1e-3)


def test_only_training_samples_count():
    u = sine()
    y = looped(u, (0.45, 0.3, 0.5))
    training = np.arange(240) < 160
    section, search = one([record(u, np.where(training, y, 1e6), training)])
    assert (section.p1, section.p2, section.p3) == pytest.approx((0.45, 0.3, 0.5), abs=1e-6)
    assert search.samples == 160


def test_a_section_is_no_slower_than_its_bound():
    u = sine(80)
    drift = np.linspace(0, 5, 80)
    section, _ = one([record(u, drift)], slowest=0.5)
    assert section.radius <= np.exp(-STEP / 0.5) + 1e-9


def test_a_record_without_training_samples_is_refused():
    with pytest.raises(DataError, match="no training sample"):
        one([record(sine(), sine(), np.zeros(240, dtype=bool))])


def test_a_boundary_at_the_end_of_the_input_cannot_be_joined():
    u = np.clip(2 * sine(), 0, 5)
    with pytest.raises(DataError, match="at an end of the training input, which goes from 0 to 5"):
        fit_motion([record(u, u)], recipe(sections=(5.0,), switching=BUMPLESS))


@pytest.mark.parametrize(("samples", "enough"), [(3, False), (4, True)])
def test_a_section_needs_more_samples_than_it_has_parameters(samples, enough):
    u = np.concatenate([np.linspace(0, 1, 20), np.linspace(2, 2.1, samples)])
    if enough:
        assert fit_motion([record(u, u)], recipe(sections=(1.5,))).searches[1].samples == 4
    else:
        with pytest.raises(DataError, match=r"section 2 .*: 3 training sample.* for 3 parameters"):
            fit_motion([record(u, u)], recipe(sections=(1.5,)))


def test_a_section_may_be_as_slow_as_a_quarter_of_the_longest_record():
    """A drift asks for a pole as slow as may be; the short record says nothing."""
    records = [record(sine(n), np.linspace(0, n, n)) for n in (80, 240)]
    assert one(records)[0].radius == pytest.approx(np.exp(-1 / (0.25 * 240)), abs=1e-7)


def test_a_pole_beyond_the_reach_is_searched_for_nowhere_and_scored_where_it_is_given():
    u = sine()
    y = looped(u, (0.0, 0.95, 0.05))
    piece = piece_of(y, input=u)
    problem = Problem([piece], reach=0.9)
    assert problem.rmse(0.0, 0.95) > 100 * np.abs(y).max()
    assert problem.rmse(0.0, 0.95, np.array([0.05])) == pytest.approx(0.0, abs=1e-9)
    assert Problem([piece], reach=0.96).rmse(0.0, 0.95) == pytest.approx(0.0, abs=1e-9)
