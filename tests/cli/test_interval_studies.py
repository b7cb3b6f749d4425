"""`predict --interval`: what a table gains, and what is refused."""

import numpy as np
import pytest
from cli_samples import csv_rows, edit, write_study

from mapmore_cli.modelling.validation.intervals import half_widths
from mapmore_cli.storage.artefacts import read_model


@pytest.fixture(scope="module")
def model_file(tmp_path_factory, mapmore):
    """A model of four levels that holds 200 kPa out, with intervals."""
    folder = tmp_path_factory.mktemp("intervals")
    spec = write_study(folder, levels=(100, 150, 200, 250, 300))
    edit(spec, "validate: {against: [polynomial_2]}", "validate: {intervals: true}")
    mapmore("fuse", spec, "--runs", folder / "runs", "-q", code=0)
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
