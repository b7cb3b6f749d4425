"""A model with memory in a study: its inputs and rules, and recordings that come block by block."""

from dataclasses import replace

import numpy as np
import pytest
from memory_samples import STEP, memory_model, narx_truth, state_set
from surfaces import curves

from mapmore_cli.domain.models import Memory, Model
from mapmore_cli.domain.recording import CurveRange, Quantity
from mapmore_cli.modelling.kinds import (
    fed_back,
    parameters,
    predict,
    rules,
    verbs_of,
)
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.memory.free_run import Along
from mapmore_cli.modelling.memory.model import MemoryVerbs
from mapmore_cli.modelling.memory.model import memory_model as model_of

NAMES = "x", "y", "z", "pressure", "strain", "force"
QUANTITIES = {name: Quantity(name, "1") for name in NAMES}


def built(names, theta, backbone=None, **more):
    """A model whose terms are these states."""
    limits = dict.fromkeys(NAMES, (0.0, 1.0))
    memory = memory_model(names, theta, state_set(*names), **more)
    return model_of("m", memory, backbone, [CurveRange("a", 1.0, limits)], QUANTITIES)


def test_inputs_are_those_of_the_states_and_of_the_backbone():
    backbone = fit_formula("sarosi", curves(), "force")
    model = built(["z[k-1]", "y[k-2]", "x"], [1.0, 2.0, 3.0], backbone)
    assert model.input_names == ("pressure", "strain", "x", "z")
    assert tuple(model.body.ranges[0].limits) == model.input_names
    assert parameters(model) == 3 + len(backbone.parameters)
    assert fed_back(model) == ("y",)
    plain = built(["x", "z[k-1]", "strain", "force", "pressure"], [1.0] * 5, constant=0.5)
    assert plain.input_names == ("force", "pressure", "strain", "x", "z")
    assert (parameters(plain), fed_back(plain)) == (6, ())
    columns = {name: x[:9] for name, x in curves()[0].columns.items()} | {"x": np.arange(9.0)}
    both, alone = (predict(built(["x"], [x], backbone), columns) for x in (2.0, 0.0))
    np.testing.assert_allclose(both, alone + 2 * np.arange(9))
    assert np.abs(alone).min() > 1


@pytest.mark.parametrize(
    ("names", "start"),
    [
        (["x", "x[k-3]"], "without measured y"),
        (["x", "y[k-1]"], "from the first measured sample of y"),
        (["y[k-1]", "y[k-3]"], "from the first 3 measured samples of y"),
    ],
)
def test_rules_say_with_which_samples_a_run_begins_and_how_it_counts_time(names, start):
    model = built(names, [0.5, 0.5])
    assert rules(model) == (f"It runs free {start}, with steps of 0.01 s.",)
    memory = model.body.model
    ordered = replace(memory, states=replace(memory.states, ordered=True))
    (rule,) = rules(replace(model, body=replace(model.body, model=ordered)))
    assert rule == f"It runs free {start}, sample by sample, whatever the time between them."
    on = built(names, [0.5, 0.5], fit_formula("sarosi", curves(), "force"))
    assert rules(on)[0] == "y is sarosi plus terms with memory."


def test_faults_are_states_that_terms_lack_and_another_output():
    alone, model = built(["x"], [0.5]), built(["x", "y[k-1]"], [0.5, 0.5])
    assert list(verbs_of(model).faults(alone)) == list(verbs_of(model).faults(model)) == []
    memory = model.body.model
    for other in (
        replace(model, output=QUANTITIES["z"]),
        replace(model, body=replace(model.body, model=replace(memory, terms=("x", "z")))),
    ):
        assert list(verbs_of(other).faults(other)) == ["its terms use states that it does not have"]


STATES = ["x[k-1]", "y[k-1]", "stop(y[k-1], 0.2)", "slow(x, 0.3)", "resonance(x, 4, 0.2)"]


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("cuts", [[1, 2, 3], [40], [7, 60, 61]])
def test_a_recording_may_come_in_blocks(cuts, ahead):
    """With a gap at sample 50, after which memory begins anew; resonances need two past values."""
    x, time = np.random.default_rng(0).uniform(-1, 1, 100), STEP * np.arange(100)
    states = state_set(*STATES, ranges={"y[k-1]": (-1.0, 1.0)})
    model = memory_model(STATES, [0.5, 0.3, 0.2, 0.1, 0.4], states, constant=0.1)
    columns = {"time": time + np.where(np.arange(100) < 50, 0, 1.0), "x": x, "y": narx_truth(x)}
    whole = Along(model, ahead)(columns).values
    verbs = MemoryVerbs()
    own = Model("m", QUANTITIES["y"], (QUANTITIES["x"],), Memory(model, ()))
    asked = {"ahead": True} if ahead else {}  # a free run is the default
    np.testing.assert_array_equal(verbs.running(own, **asked)(columns).values, whole)
    np.testing.assert_array_equal(verbs.simulate(own, columns, **asked).values, whole)
    assert np.flatnonzero(np.isnan(whole)).tolist() == [0, 50]
    next_rows = Along(model, ahead)
    blocks = [
        {name: column[rows] for name, column in columns.items()}
        for rows in np.split(np.arange(100), cuts)
    ]
    found = [next_rows(block).values for block in blocks]
    np.testing.assert_allclose(np.concatenate(found), whole, rtol=1e-12)
