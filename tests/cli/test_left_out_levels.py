"""What left-out levels say: every level is predicted as a run that holds it out predicts it; a
backbone is chosen.
"""

import json

import numpy as np
import pytest
from cli_samples import write_study

from mapmore_cli.storage.artefacts import read_model

HELD = "{validate: {pressure: [200]}}"
AGAINST = "against: [polynomial_2, {set: {fit.max_terms: 2}, as: two_terms}]"


def rows(mapmore, spec, runs, command="validate"):
    result = mapmore(command, spec, "--runs", runs, "--json", "-q", code=0)
    return {
        (row["model"], row["split"], row["curve"]): row
        for row in json.loads(result.stdout)["scores"]
    }


@pytest.mark.parametrize(
    ("model", "rivals", "levels"),
    [
        ("", ("polynomial_2", "two_terms"), (100, 200, 300)),
        ("model: {backbone: polynomial_2}\n", ("polynomial_2",), (200,)),
        ("model: {type: literature, name: sarosi}\n", ("polynomial_2",), (300,)),
    ],
)
def test_every_level_is_predicted_as_by_a_run_without_it(model, rivals, levels, tmp_path, mapmore):
    """All levels once; an inner one and an end of other models."""
    spec = write_study(tmp_path)
    text = spec.read_text() + model
    if "two_terms" in rivals:
        text = text.replace("against: [polynomial_2]", AGAINST)
    assert HELD in text
    spec.write_text(text.replace(HELD, "{leave_one_level_out: true}"))
    found = rows(mapmore, spec, tmp_path / "runs")
    squares, samples = 0.0, 0
    for level in (100, 200, 300):
        own = found["mapmore", "validate", f"pressure={level}"]
        squares, samples = squares + own["n"] * own["rmse"] ** 2, samples + own["n"]
    assert found["mapmore", "validate", "all"]["rmse"] == pytest.approx(
        np.sqrt(squares / samples), rel=1e-9
    )
    for level in levels:
        single = tmp_path / f"without_{level}.yaml"
        single.write_text(
            text.replace("name: bench", f"name: without_{level}").replace("[200]", f"[{level}]")
        )
        alone = rows(mapmore, single, tmp_path / "runs")
        for name in ("mapmore", *rivals):
            left_out, held = (
                found[name, "validate", f"pressure={level}"],
                alone[name, "validate", f"pressure={level}"],
            )
            assert left_out["rmse"] == pytest.approx(held["rmse"], rel=1e-9)


def test_the_saved_model_and_the_training_rows_are_of_all_data(tmp_path, mapmore):
    spec = write_study(tmp_path)
    plain = spec.read_text()
    spec.write_text(plain.replace(HELD, "{leave_one_level_out: true}"))
    found = rows(mapmore, spec, tmp_path / "runs", "run")
    whole = tmp_path / "whole.yaml"
    whole.write_text(plain.replace("name: bench", "name: whole").replace(f"split: {HELD}", ""))
    alone = rows(mapmore, whole, tmp_path / "runs")
    assert [
        curve.level for curve in read_model(tmp_path / "runs" / "bench" / "model.h5").body.curves
    ] == [100.0, 200.0, 300.0]
    assert found["mapmore", "train", "all"]["rmse"] == alone["mapmore", "train", "all"]["rmse"]
    assert (
        found["mapmore", "train", "all"]["normaliser"]
        == found["mapmore", "validate", "all"]["normaliser"]
    )
    page = (tmp_path / "runs" / "bench" / "report" / "index.html").read_text()
    assert "Every level is left out in turn" in page


def test_models_over_time_have_no_levels_to_leave_out(tmp_path, mapmore):
    spec = write_study(tmp_path)
    text = spec.read_text().replace(HELD, "{leave_one_level_out: true}")
    spec.write_text(
        text.split("dictionary:")[0] + "dictionary: [{lags: {of: [strain], steps: [1]}}]\n"
    )
    mapmore(
        "run",
        spec,
        "--runs",
        tmp_path / "runs",
        code=3,
        says="neither a model with memory nor a sum",
    )


def test_the_run_tells_what_it_chose(tmp_path, mapmore):
    """The study has three training levels: too few for a choice, which is said."""
    spec, runs = write_study(tmp_path), tmp_path / "runs"
    mapmore(
        "validate",
        spec,
        "--runs",
        runs,
        "--set",
        "model.backbone=auto",
        "--set",
        "fit.max_terms=2",
        code=0,
    )
    shown = json.loads(mapmore("show", runs / "bench" / "model.h5", "--json").stdout)
    assert "too few to choose a backbone by" in " ".join(shown["notes"])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            ["segment={strain: {method: optimal, count: 2}}"],
            "`optimal` ones depend on the backbone",
        ),
        (
            ["dictionary=[{lags: {of: [force], steps: [1], order: 1}}]", "segment={}"],
            "a model with memory has none",
        ),
    ],
)
def test_a_choice_that_cannot_be_made_is_refused(settings, words, tmp_path, mapmore):
    spec = write_study(tmp_path)
    given = [part for setting in ["model.backbone=auto", *settings] for part in ("--set", setting)]
    mapmore("fit", spec, "--runs", tmp_path / "runs", *given, code=3, says=words)
