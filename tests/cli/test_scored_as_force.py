"""`validate: {as: force}`: a model of the strain is inverted, and scored as force beside the direct
one.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from cli_samples import SPEC

TURNED = (
    "target={column: strain}",
    "segment={force: {method: even, count: 2, min_samples: 6}}",
    "dictionary=[{polynomial: {of: [force], order: 2}}]",
    "fit={max_terms: 2}",
)


def options(*settings):
    return [part for setting in settings for part in ("--set", setting)]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The force is set, alike at three pressures, and the strain measured."""
    folder, rng = tmp_path_factory.mktemp("turned"), np.random.default_rng(5)
    for level in (100, 200, 300):
        force = np.linspace(0.0, 150.0, 40)
        strain = (0.05 + 0.0004 * level) * (1 - force / 400) + rng.normal(0, 2e-4, 40)
        lines = [f"{level},{e:.5f},{f:.3f}" for e, f in zip(strain, force, strict=True)]
        (folder / f"bench_{level}.csv").write_text("\n".join(["P,eps,F", *lines]) + "\n")
    spec = folder / "bench.yaml"
    spec.write_text(
        SPEC.format(
            name="bench", levels=[100, 200, 300], split="  split: {validate: {pressure: [200]}}\n"
        )
    )
    return spec


def scores(runs, name):
    rows = json.loads((runs / name / "scores.json").read_text())["scores"]
    return {(row["model"], row["split"]): row for row in rows if row["curve"] == "all"}


def test_all_rows_are_of_the_force(study, tmp_path, mapmore):
    """The inverted model has the error that inverting it by hand, in `predict`, gives; the formulas
    have that of the direct study.
    """
    runs = tmp_path / "runs"
    given = options(*TURNED, "validate={as: force, against: [polynomial_2]}", "name=turned")
    mapmore("run", study, "--runs", runs, *given, code=0)
    mapmore(
        "validate", study, "--runs", runs, *options("validate={against: [polynomial_2]}"), code=0
    )
    rows, direct_rows = scores(runs, "turned"), scores(runs, "bench")
    assert {row["target"] for row in rows.values()} == {"force"}
    assert json.loads((runs / "turned" / "scores.json").read_text())["units"] == {"force": "N"}
    assert rows["polynomial_2", "validate"] == {
        **direct_rows["polynomial_2", "validate"],
        "target": "force",
    }
    measured = study.parent / "bench_200.csv"
    table = tmp_path / "table.csv"
    table.write_text(
        "\n".join(["pressure,strain,force", *measured.read_text().splitlines()[1:]]) + "\n"
    )
    out = tmp_path / "out.csv"
    mapmore("predict", runs / "turned" / "model.h5", table, "-o", out, "--as", "force", code=0)
    found = np.genfromtxt(out, delimiter=",", names=True, dtype=None, encoding="utf-8")
    error = np.sqrt(np.mean((found["force_predicted"] - found["force"]) ** 2))
    assert rows["mapmore", "validate"]["rmse"] == pytest.approx(error, rel=1e-6)
    assert rows["mapmore", "validate"]["nrmse"] < 0.05
    page = (runs / "turned" / "report" / "index.html").read_text()
    assert "The model predicts strain; it is inverted, and scored as force." in page


def test_the_inverted_model_stands_beside_the_direct_one(study, tmp_path, mapmore):
    """As a competitor whose target is another, also where every level is left out in turn."""
    runs = tmp_path / "runs"
    changed = "{target: {column: strain}, segment: {force: {method: even, count: 2}}, " + (
        "dictionary: [{polynomial: {of: [force], order: 2}}], fit: {max_terms: 2}}"
    )
    given = options(
        f"validate={{against: [{{set: {changed}, as: inverted}}]}}",
        "data.split={leave_one_level_out: true}",
    )
    mapmore("validate", study, "--runs", runs, *given, code=0)
    rows = scores(runs, "bench")
    assert {"mapmore", "inverted"} <= {model for model, _ in rows}
    assert rows["inverted", "validate"]["n"] == 120
    assert 0 < rows["inverted", "validate"]["nrmse"] < 1


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["validate.as=force"], "needs a model of another quantity"),
        ([*TURNED, "validate.as=strain"], "needs a model of another quantity"),
        ([*TURNED, "validate.as=load"], "there is no quantity `load`"),
        (
            [*TURNED, "validate.as=force", "model={type: literature, name: polynomial_2}"],
            "only a model of pieces",
        ),
        (
            [
                "target={column: strain}",
                "segment={}",
                "dictionary=[{polynomial: {of: [pressure], order: 1}}]",
                "validate.as=force",
            ],
            "cannot be inverted for `force`",
        ),
    ],
)
def test_what_cannot_be_inverted_is_refused(settings, words, study, tmp_path, mapmore):
    mapmore(
        "validate",
        study,
        "--runs",
        tmp_path / "runs",
        *options("validate.against=[]", *settings),
        code=3,
        says=words,
    )


def test_a_table_is_turned_with_its_flags(study, tmp_path, mapmore):
    runs = tmp_path / "runs"
    mapmore("fuse", study, "--runs", runs, *options(*TURNED), code=0)
    model, table = runs / "bench" / "model.h5", tmp_path / "table.csv"
    table.write_text("pressure,strain\n200,0.1\n200,5\n200,\n")
    shown = mapmore("predict", model, table, "--as", "force", code=0)
    header, inside, beyond, empty = shown.stdout.splitlines()
    assert header == "pressure,strain,force_predicted,outside_range"
    assert inside.endswith("false")
    assert beyond.endswith("true")
    assert empty == "200,,,"
    mapmore("predict", model, table, "--as", "load", code=2)
    mapmore("predict", model, table, "--as", "force", "--derivatives", code=2)
