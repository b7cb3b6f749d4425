"""What left-out levels say: every level is predicted as a run that holds it out predicts it; a
backbone is chosen.
"""

from pathlib import Path

import pytest
from cli_samples import OWN, by_place, edit

from mapmore_cli.cli.views import verdict_lines

HELD = "{validate: {pressure: [200]}}"
AGAINST = "against: [polynomial_2, {set: {fit.max_terms: 2}, as: two_terms}]"


@pytest.mark.parametrize(
    ("model", "rivals", "levels"),
    [
        ("", ("polynomial_2", "two_terms"), (100, 200, 300)),
        ("model: {backbone: polynomial_2}\n", ("polynomial_2",), (200,)),
        ("model: {type: literature, name: sarosi}\n", ("polynomial_2",), (300,)),
    ],
)
def test_every_level_is_predicted_as_by_a_run_without_it(model, rivals, levels, study, document):
    """All levels once; an inner one and an end of other models."""
    if "two_terms" in rivals:
        edit(study, "against: [polynomial_2]", AGAINST)
    text = study.read_text() + model
    study.write_text(text)
    edit(study, HELD, "{leave_one_level_out: true}")
    found = by_place(document("validate", study, "-q"))
    own = [found["mapmore", "validate", f"pressure={level}"] for level in (100, 200, 300)]
    assert found[OWN]["rmse"] ** 2 == pytest.approx(
        sum(row["n"] * row["rmse"] ** 2 for row in own) / sum(row["n"] for row in own), rel=1e-9
    )
    for level in levels:
        study.write_text(text.replace("[200]", f"[{level}]"))
        alone = by_place(document("validate", study, "-q", "--set", f"name=without_{level}"))
        for name in ("mapmore", *rivals):
            place = (name, "validate", f"pressure={level}")
            assert found[place]["rmse"] == pytest.approx(alone[place]["rmse"], rel=1e-9)


def test_models_over_time_have_no_levels_to_leave_out(study, mapmore):
    text = study.read_text().replace(HELD, "{leave_one_level_out: true}")
    study.write_text(
        text.split("dictionary:")[0] + "dictionary: [{lags: {of: [strain], steps: [1]}}]\n"
    )
    mapmore("run", study, code=3, says="a model with memory or a sum cannot be fitted")


def test_a_competitor_that_was_trained_on_what_is_held_out_is_named_and_not_compared(
    study, mapmore
):
    text = study.read_text()
    other = study.with_name("other.yaml")
    other.write_text(text.replace("name: bench", "name: other").replace(f"split: {HELD}", ""))
    rivals = "against: [{run: other.yaml, as: whole}, {set: {fit.max_terms: 2}, as: two_terms}]"
    edit(study, "against: [polynomial_2]", rivals)
    mapmore("validate", study, "-q", code=0)
    (verdict,) = verdict_lines(Path("runs/bench"))
    assert "whole was trained on held-out samples, and is not compared" in verdict
    assert "two_terms was" not in verdict
