"""Intervals from a spec to a table: what is left out of each kind of study, `predict --interval`,
figures, notebooks.
"""

from pathlib import Path

import numpy as np
import pytest
import test_memory_pipeline as memory
from cli_samples import csv_rows, edit, write_study

from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.validation.intervals import half_widths, many_curves
from mapmore_cli.storage.artefacts import read_dataset, read_model

HELD = "  split: {validate: {pressure: [200]}}\n"


def asked(spec, *changes):
    """The study, asked for intervals."""
    edit(spec, "validate: {against: [polynomial_2]}", "validate: {intervals: true}")
    for change in changes:
        edit(spec, *change)
    return spec


def fused(mapmore, spec):
    """The model of a study."""
    mapmore("fuse", spec, "-q", code=0)
    return read_model(Path("runs", spec.stem, "model.h5"))


def test_an_inner_level_is_missed_as_by_a_run_that_holds_it_out(study, mapmore):
    """Of models of other kinds, `test_left_out_levels.py` says the same of scores."""
    asked(study)
    held = study.with_name("held.yaml")
    text = study.read_text()
    held.write_text(text.replace("name: bench", "name: held").replace("{intervals: true}", "{}"))
    edit(study, HELD, "")
    left_out = fused(mapmore, study).left_out
    assert (left_out.kind, left_out.curves, left_out.parts) == ("levels", 3, ("pressure=200",))
    without = fused(mapmore, held)
    curve = read_dataset(Path("runs", "held", "ingest.h5")).curves[1]
    errors = curve.columns["force"] - forecast(without, curve).values
    assert left_out.samples.tolist() == [curve.size]
    assert [left_out.offset[0], left_out.scatter[0], *left_out.sizes[0, [0, 50, 100]]] == (
        pytest.approx(
            [errors.mean(), errors.std(), *np.quantile(np.abs(errors), [0, 0.5, 1])], rel=1e-9
        )
    )


def test_a_model_with_memory_is_told_by_free_runs_over_blocks(tmp_path, mapmore):
    spec = memory.write_study(tmp_path, "narx", memory.NARX, memory.narx)
    edit(spec, "validate: {normaliser", "validate: {intervals: true, normaliser")
    model = fused(mapmore, spec)
    assert (model.left_out.kind, model.left_out.parts[0], len(model.left_out.parts)) == (
        "blocks",
        "block 1 of 5",
        5,
    )
    dataset = read_dataset(tmp_path / "runs" / "narx" / "ingest.h5")
    new = next(curve for curve in dataset.curves if curve.held_out.all())
    said = forecast(model, new)
    errors = (new.columns["displacement"] - said.values)[said.ready]
    assert np.abs(errors).max() <= many_curves(model.left_out, 0.999)


@pytest.fixture(scope="module")
def model_file(tmp_path_factory, mapmore):
    """A run of four levels that holds 200 kPa out, with intervals; its page as well."""
    folder = tmp_path_factory.mktemp("intervals")
    spec = asked(
        write_study(folder, levels=(100, 150, 200, 250, 300)),
        ("figures: []", "figures: [fit]"),
        ("formats: [html, csv", "formats: [html, svg"),
    )
    mapmore("run", spec, "--runs", folder / "runs", "-q", code=0)
    return folder / "runs" / "bench" / "model.h5"


TABLE = "pressure,strain\n100,0.01\n150,0.02\n400,0.02\n,0.02\n"


def test_a_table_gains_the_ends(model_file, mapmore):
    result = mapmore(
        "predict", model_file, "-", "--interval", "0.9", "--derivatives", stdin=TABLE, code=0
    )
    rows = csv_rows(result.stdout)
    assert list(rows[0])[2:] == [
        "force_predicted",
        "outside_range",
        "force_low",
        "force_high",
        "force_by_pressure",
        "force_by_strain",
    ]
    halves = half_widths(read_model(model_file).left_out, np.array([100.0, 150.0]), 0.9)
    for row, half in zip(rows, halves.tolist(), strict=False):
        low, middle, high = (float(row[f"force_{end}"]) for end in ("low", "predicted", "high"))
        assert [low, high] == pytest.approx([middle - half, middle + half])
    assert (rows[2]["outside_range"], rows[2]["force_low"], rows[2]["force_high"]) == (
        "true",
        "",
        "",
    )
    assert [rows[3][name] for name in ("force_predicted", "force_low")] == ["", ""]
    assert rows[2]["force_by_strain"] != ""


BAD = {
    "a level of 95": (["95"], TABLE, 2),
    "a column taken": (["0.95"], TABLE.replace("strain", "strain,force_low", 1), 4),
}


@pytest.mark.parametrize("what", [*BAD, "a model without"])
def test_bad_asks_are_refused(what, model_file, mapmore, finished):
    model = finished[1] / "bench" / "model.h5" if what == "a model without" else model_file
    arguments, table, code = BAD.get(what, (["0.95"], TABLE, 4))
    result = mapmore("predict", model, "-", "--interval", *arguments, stdin=table)
    assert (result.exit_code, result.stdout) == (code, "")
    assert ("validate: {intervals: true}" in result.stderr) == (model != model_file)
