"""Models whose parts do not match are refused, with the part that does not match."""

from dataclasses import replace

import pytest
from export_samples import STATIC

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.soundness import unsound

MODEL = STATIC["backbone, shrunken"]


@pytest.mark.parametrize(
    ("inputs", "reason"),
    [
        (MODEL.inputs, None),
        (MODEL.inputs[:1], "in the model dmsp-20: sarosi needs strain, which the model lacks"),
        ((*MODEL.inputs, MODEL.output), "in the model dmsp-20: two quantities have the same name"),
        ((*MODEL.inputs, Quantity("load", "N")), "its parts do not match (KeyError: 'load')"),
    ],
)
def test_a_model_has_the_inputs_of_its_parts_and_each_name_once(inputs, reason):
    found = unsound(replace(MODEL, inputs=inputs))
    assert found is None if reason is None else reason in found
