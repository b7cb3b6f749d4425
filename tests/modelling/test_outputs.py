"""One model of several outputs: what it says of all of them, and which models it cannot hold."""

from dataclasses import replace

import numpy as np
import pytest
from export_samples import FORMULAS, STATIC

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.outputs.model import OutputsVerbs, outputs_model

FORCE = STATIC["steps"]
STIFFNESS = replace(FORCE, output=Quantity("stiffness", "N"), notes=("of the stiffness",))
BOTH = outputs_model("both", (FORCE, STIFFNESS))


def test_a_model_of_two_outputs_has_the_parameters_and_equations_of_both():
    assert kinds.parameters(BOTH) == 2 * kinds.parameters(FORCE)
    names = [one.id for one in kinds.equations(FORCE)]
    expected = [f"{output}: {name}" for output in ("force", "stiffness") for name in names]
    assert [one.id for one in kinds.equations(BOTH)] == expected
    assert (kinds.rules(BOTH), BOTH.notes) == (kinds.rules(FORCE), STIFFNESS.notes)
    with pytest.raises(UsageError, match="outputs force, stiffness"):
        kinds.predict(BOTH, {})


def test_a_row_is_outside_if_it_is_outside_for_one_output(monkeypatch):
    limits = {"force": 0.3, "stiffness": 0.1}
    monkeypatch.setattr(kinds, "outside_range", lambda one, x: x["x"] > limits[one.output.name])
    assert OutputsVerbs().outside_range(BOTH, {"x": np.array([0.0, 0.2, 0.4])}).tolist() == [
        *(False, True, True)
    ]


@pytest.mark.parametrize(
    ("model", "fault"),
    [
        (BOTH, None),
        (outputs_model("one", (FORCE,)), "at least two outputs"),
        (outputs_model("twice", (FORCE, FORCE)), "different names"),
        (replace(BOTH, output=STIFFNESS.output), "different names"),
        (replace(BOTH, inputs=BOTH.inputs[:1]), "inputs are not those"),
        (outputs_model("mixed", (FORCE, FORMULAS["peternel"])), "do not share their segments"),
        (outputs_model("nested", (BOTH, STIFFNESS)), "itself a model of several outputs"),
    ],
)
def test_faults_of_a_model_of_several_outputs(model, fault):
    found = [*OutputsVerbs().faults(model)]
    assert not found if fault is None else any(fault in one for one in found)
