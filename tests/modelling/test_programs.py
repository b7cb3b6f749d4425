"""A model as a program: what it keeps from sample to sample, and parts that cannot be one."""

from dataclasses import replace

import numpy as np
import pytest
from agreement import difference, imported, recording
from export_samples import WITH_MEMORY

from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import CurveRange
from mapmore_cli.modelling.expressions import Name
from mapmore_cli.modelling.kinds import fed_back, predict
from mapmore_cli.modelling.memory.simulation import divergence_bounds
from mapmore_cli.modelling.program.values import ready_for_one_sample
from mapmore_cli.modelling.program.writing import Writer, limit
from mapmore_cli.modelling.programs import program_of


@pytest.mark.parametrize(
    ("name", "sizes"), [("lags", {3, 1}), ("operators of the output", {2, 1, 6})]
)
def test_queues_are_as_long_as_the_oldest_value_that_is_recalled(name, sizes):
    """`pressure[k-3]` beside `pressure[k-2]` needs three values, not two and not five."""
    assert {*program_of(WITH_MEMORY[name]).kept.queues.values()} == sizes


@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize("name", WITH_MEMORY)
def test_a_module_computes_sample_by_sample_what_the_model_predicts(name, plain):
    model = WITH_MEMORY[name]
    module, columns = imported(model, plain), recording(model, 300)
    state = module.State()
    found = []
    for row in range(300):
        found.append(module.step(state, **{one: columns[one][row] for one in module.INPUTS}))
        if fed_back(model) and np.isnan(found[-1]) and row < 10:
            state.measured(columns["force"][row])
    with np.errstate(all="ignore"):
        expected = predict(model, columns)
    assert difference(np.array(found), expected) < 1e-12


def at_step(step):
    model = WITH_MEMORY["operators"]
    body = model.body
    states = replace(body.model.states, step=step)
    return replace(model, body=replace(body, model=replace(body.model, states=states)))


@pytest.mark.parametrize("order", [1, -1])
def test_parts_of_a_sum_count_the_same_steps(order):
    """To a thousandth, by which steps of one recording may differ."""
    alike = [Part(at_step(step)) for step in (0.01, 0.010009)][::order]
    unlike = [Part(at_step(step)) for step in (0.01, 0.010011)][::order]
    model = at_step(0.01)
    assert len(program_of(replace(model, body=Sum(tuple(alike)))).kept.steps) == 2
    with pytest.raises(
        DataError, match=r"were trained with different time steps, 0.01 s and 0.010011 s"
    ):
        program_of(replace(model, body=Sum(tuple(unlike))))


def test_a_value_whose_range_is_known_stays_in_the_program():
    m = Writer()
    double, _ = m.let("double", 2 * Name("x_a")), m.let("unused", 3 * Name("x_a"))
    limit(m, [CurveRange("all", None, {"a": (0.0, 1.0)})], None, {"a": double})
    program = m.program(("a",), Name("x_a"))
    assert [statement.name for statement in program.body.statements] == [double.name]
    assert program.knots == {"a": (0.0, 1.0)}


@pytest.mark.parametrize(("x", "clipped"), [(-2.0, -1.0), (0.5, 0.5), (3.0, 2.0)])
def test_a_branch_of_one_sample_is_that_of_the_first_condition_that_holds(x, clipped):
    m = Writer()
    block = m.side(lambda: m.clip(Name("x"), -1.0, m.use("y", "double", [1.0])))
    run = ready_for_one_sample(block, {"double": lambda _m, one: 2 * one})
    assert run({"x": np.float64(x)}, 1) == [clipped]


@pytest.mark.parametrize("end", [0, 1])
def test_an_output_at_the_end_of_the_bounds_has_not_diverged(end):
    model = WITH_MEMORY["diverging"]
    memory = replace(model.body.model, theta=np.array([0.0, 1.0]), constant=0.0)
    model = replace(model, body=replace(model.body, model=memory))  # the output is the pressure
    bound = divergence_bounds(memory.limits)[end]
    pressure = np.array([1.0, 1.0, 1.0, bound, 1.0, 2 * bound, 1.0])
    module = imported(model, plain=False)
    state = module.State()
    found = []
    for value in pressure:
        found.append(module.step(state, pressure=value))
        if len(found) <= 3:
            state.measured(1.0)
    expected = [np.nan] * 3 + [bound, 1.0, np.nan, np.nan]
    np.testing.assert_array_equal(found, expected)
    columns = {"pressure": pressure, "force": np.ones(7)}
    np.testing.assert_array_equal(predict(model, columns), expected)


@pytest.mark.parametrize(
    "pressure",
    [
        # a rise, a fall by just the dead band of 25, and rises and falls by more
        [100, 150, 125, 150, 160, 170, 180],
        [200, 100, 125, 100, 90, 110, 140, 170],
        [200, 240, 240, 230, 240, 250, 260],  # sections meet at 240
    ],
)
def test_a_program_switches_sections_at_the_same_samples_as_the_model(pressure):
    model = WITH_MEMORY["motion, handed on"]
    module, n = imported(model, plain=False), len(pressure)
    columns = {"pressure": np.array(pressure, dtype=float), "strain": np.full(n, 0.1)}
    state = module.State()
    found = [module.step(state, pressure=one, strain=0.1) for one in columns["pressure"].tolist()]
    np.testing.assert_allclose(found, predict(model, columns), rtol=1e-12)
