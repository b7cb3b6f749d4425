"""`fit: {max_terms: auto}`: the number of terms by training data that are left out in turn."""

from __future__ import annotations

import json

import numpy as np
import pytest
from cli_samples import change_forces
from test_cli_tune import tuned, write_bench, write_record

from mapmore_cli.storage.artefacts import read_fit, read_model


def run_auto(mapmore, spec, *more):
    """The fit and the model of a run that chooses the number of terms."""
    arguments = [
        "fuse",
        spec,
        "--runs",
        spec.parent / "runs",
        "-q",
        "--set",
        "fit.max_terms=auto",
        *more,
    ]
    mapmore(*arguments, code=0)
    folder = spec.parent / "runs" / spec.stem
    return read_fit(folder / "fit.h5"), read_model(folder / "model.h5")


def test_it_is_the_number_that_tune_names(tmp_path, mapmore):
    spec = write_bench(tmp_path)
    one_segment = ("--set", "segment.strain.count=1")
    fit, model = run_auto(mapmore, spec, *one_segment)
    wanted = tuned(mapmore, spec, "--over", "fit.max_terms=1,2,3,4", *one_segment)
    assert fit.max_terms == wanted["chosen"]["fit.max_terms"]
    assert max(len(one.terms) for one in fit.segments) == fit.max_terms
    note = next(note for note in model.notes if note.startswith(f"at most {fit.max_terms} term(s)"))
    for trial in wanted["trials"]:
        assert f"{trial['set']['fit.max_terms']}: {100 * trial['error']:.3g}" in note
    given, _ = run_auto(mapmore, spec, *one_segment, "--set", f"fit.max_terms={fit.max_terms}")
    assert given.max_terms == 0
    assert [(one.id, one.terms) for one in given.segments] == [
        (one.id, one.terms) for one in fit.segments
    ]


def test_held_out_forces_have_no_say(tmp_path, mapmore):
    spec = write_bench(tmp_path)
    backbone = ("--set", "model.backbone=polynomial_2", "--set", "segment.strain.count=1")
    _, before = run_auto(mapmore, spec, *backbone)
    change_forces(tmp_path / "bench_300.csv", lambda force: 7.0 * np.arange(len(force)))
    _, after = run_auto(mapmore, spec, *backbone)
    assert after.notes == before.notes
    for one, other in zip(before.body.segments, after.body.segments, strict=True):
        np.testing.assert_array_equal(one.theta, other.theta)


def test_a_left_out_level_chooses_anew(tmp_path, mapmore):
    spec = write_bench(tmp_path)
    spec.write_text(
        spec.read_text().replace("{validate: {pressure: [300]}}", "{leave_one_level_out: true}")
    )
    settings = ("--set", "segment.strain.count=1", "--set", "fit.max_terms=auto")
    result = mapmore("validate", spec, "--runs", tmp_path / "runs", "--json", "-q", *settings)
    left_out = {
        row["curve"]: row["rmse"]
        for row in json.loads(result.stdout)["scores"]
        if row["split"] == "validate"
    }
    alone = write_bench(tmp_path, held_out=(400,))
    result = mapmore("validate", alone, "--runs", tmp_path / "others", "--json", "-q", *settings)
    held = {
        row["curve"]: row["rmse"]
        for row in json.loads(result.stdout)["scores"]
        if row["split"] == "validate"
    }
    assert left_out["pressure=400"] == pytest.approx(held["pressure=400"], rel=1e-9)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (["fit.max_terms=auto", "fit.stop=free_run"], "both choose the number of terms"),
        (["fit.max_terms=car"], "should be a whole number"),
    ],
)
def test_what_is_wrong_is_told(settings, told, tmp_path, mapmore):
    arguments = [argument for setting in settings for argument in ("--set", setting)]
    result = mapmore("fit", write_bench(tmp_path), "--runs", tmp_path / "runs", *arguments)
    assert (result.exit_code, told in result.stderr) == (3, True), result.stderr


def test_with_memory_too(tmp_path, mapmore):
    rng = np.random.default_rng(3)
    p = rng.normal(0, 20, 300)
    force = np.convolve(p, [0.5, 0.3, 0.2, 0.1])[:300] + rng.normal(0, 0.5, 300)
    fit, _ = run_auto(mapmore, write_record(tmp_path, p, force, lags=8))
    assert fit.max_terms == 4
    assert set(fit.memory.model.terms) == {
        "pressure",
        "pressure[k-1]",
        "pressure[k-2]",
        "pressure[k-3]",
    }
