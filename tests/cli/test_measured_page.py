"""docs/measured-static.md says what the studies say: its tables fit each other, the simulated ones
are run again.

`test_shipped_studies` runs the measured studies and holds them against the page.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from page_tables import PAGE, numbers, page_table
from test_shipped_studies import CONFIGS, NRMSE

from mapmore_cli.modelling.kinds import predict
from mapmore_cli.spec.campaign import load_campaign
from mapmore_cli.storage.artefacts import read_model

CLOSING = ("ratio, geometric mean", "ratio, worst", "runs better", "below the best formula")
DIGITS = 0.006  # three of them


def test_the_gel_muscle_is_what_its_recordings_say(measured_data):
    """The polynomials, left out by least squares of their own; the means of all models."""
    table = {model: numbers(row) for model, row in page_table("pgm").items()}
    files = sorted((measured_data / "pgm_mckibben").glob("pgm_*kPa.csv"))
    rows = np.concatenate([np.genfromtxt(path, delimiter=",", names=True) for path in files])
    p, e, force = rows["pressure_kPa"] / 300, rows["strain"], rows["force_N"]
    for order in (2, 5):
        powers = [
            (i, j)
            for i in range(order + 1)
            for j in range(order + 1 - i)
            if (order, i, j) != (2, 0, 2)
        ]  # M2 eq 15 has no P^2
        terms = np.column_stack([e**i * p**j for i, j in powers])
        for pressure in (50, 100, 150, 200, 250):
            out = rows["pressure_kPa"] == pressure
            beta = np.linalg.lstsq(terms[~out], force[~out], rcond=None)[0]
            error = np.sqrt(np.mean((terms[out] @ beta - force[out]) ** 2)) / force.max()
            assert 100 * error == pytest.approx(
                table[f"polynomial_{order}"][f"{pressure} kPa"], rel=0.01
            )
    for row in table.values():
        assert row["mean"] == pytest.approx(
            sum(row[f"{pressure} kPa"] for pressure in (50, 100, 150, 200, 250)) / 5, rel=DIGITS
        )


def test_the_piston_of_the_printed_cylinder(tmp_path, mapmore, measured_data):
    mapmore(
        "fuse", CONFIGS / "cylinder" / "printed_cylinder.yaml", "--runs", tmp_path, "-q", code=0
    )
    model = read_model(tmp_path / "printed_cylinder" / "model.h5")
    low, high = predict(
        model, {"pressure": np.array([200.0, 600.0]), "displacement": np.array([0.01, 0.01])}
    )
    slope = f"a constant and {(high - low) / 400:.3f} N/kPa"
    assert slope in PAGE.read_text(encoding="utf-8")


def test_the_simulated_studies_are_those_that_run():
    for name, row in page_table("m1").items():
        if name not in CLOSING:
            for model, nrmse in NRMSE[name].items():
                assert float(row[model]) == pytest.approx(100 * nrmse, rel=0.01)


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.long)])
def test_the_sweep_of_terms_gives_its_table(step, tmp_path, mapmore):
    """Every fifth entry is one of each study and of each column."""
    _, entries = load_campaign(CONFIGS / "campaigns" / "m1_terms.yaml")
    table = page_table("m1-terms")
    columns = {"1": "one term", "2": "two", "3": "three", "order2": "two of 1, x, x²"}
    assert len(entries) == len(table) * len(columns)
    seen = set()
    for entry in entries[::step]:
        overrides = [part for override in entry.overrides for part in ("--set", override)]
        result = mapmore(
            "validate",
            entry.config,
            "--runs",
            tmp_path,
            "--json",
            "-q",
            *overrides,
            "--set",
            "validate.against=[]",
        )
        document = json.loads(result.stdout)
        (nrmse,) = (
            row["nrmse"]
            for row in document["scores"]
            if (row["split"], row["curve"]) == ("validate", "all")
        )
        study, _, variant = document["name"].rpartition("-")
        assert 100 * nrmse == pytest.approx(float(table[study][columns[variant]]), rel=DIGITS)
        seen |= {study, variant}
    assert seen == {*table, *columns}
