"""A model as a program: what it keeps from sample to sample, and parts that cannot be one."""

from dataclasses import replace

import numpy as np
import pytest
from agreement import difference, imported, recording
from export_samples import WITH_MEMORY

from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.kinds import fed_back, predict
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
