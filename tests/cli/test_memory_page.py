"""docs/memory.md says what the runs say: its tables fit each other, and some of the runs are done
again.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from cli_samples import held_out
from page_tables import MEMORY, numbers, page_table
from test_shipped_studies import CONFIGS, NRMSE

from mapmore_cli.spec.campaign import load_campaign
from mapmore_cli.storage.artefacts import read_fit, read_model

REVERSALS = ("dmsp-20-88-inner-reversals", "peano-inner-reversals")
DIGITS = 0.006  # three of them
FEWER = "steps-2-500g"
"""Beside a competitor that does not predict all of its samples, this one has fewer; the table of
cuts has it by itself.
"""
AGAIN = {"coiled": ["loops-2-200g", FEWER], "coiled_loads": ["loads-2-400g-from-300g-500g"]}
"""Runs of the campaigns that are done again: one that needs no cutting, one that does, and one of
another load.
"""


def campaign(name):
    """A shipped campaign, its runs by their names."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / f"{name}.yaml")
    return spec, {
        str(variant.name): entry for variant, entry in zip(spec.runs, entries, strict=True)
    }


def rows_of(table):
    """NRMSE in per cent of the runs of a campaign, by run and model."""
    _, runs = campaign(table)
    found = page_table(table, MEMORY)
    return {name: numbers(found[name]) for name in runs}


def nrmse(mapmore, entry, runs):
    """NRMSE in per cent of a run's own model on what was held out."""
    overrides = [part for override in entry.overrides for part in ("--set", override)]
    result = mapmore(
        "validate",
        entry.config,
        "--runs",
        runs,
        "--json",
        "-q",
        *overrides,
        "--set",
        "validate.against=[]",
        code=0,
    )
    return float(100 * held_out(json.loads(result.stdout))["mapmore"]["nrmse"])


def test_the_campaign_has_every_record_and_one_fragment():
    spec, runs = campaign("coiled")
    assert [
        sum(variant.group == group for variant in spec.runs) for group in ("steps", "loops")
    ] == [10, 5]
    assert {entry.config.name for entry in runs.values()} == {
        "coiled_steps.yaml",
        "coiled_loops.yaml",
    }
    assert all(set(variant.set) <= {"data.files"} for variant in spec.runs)


@pytest.mark.parametrize(
    ("table", "name"), [(table, name) for table, names in AGAIN.items() for name in names]
)
def test_a_run_gives_what_the_page_says(table, name, tmp_path, mapmore, measured_data):
    _, runs = campaign(table)
    told = (
        numbers(page_table("uncut", MEMORY)[name])["cut"]
        if name == FEWER
        else rows_of(table)[name]["mapmore"]
    )
    assert nrmse(mapmore, runs[name], tmp_path) == pytest.approx(told, rel=0.02)


def test_the_true_terms_of_the_simulated_record(tmp_path, mapmore, measured_data):
    mapmore(
        "fuse",
        CONFIGS / "identification" / "data_for_testing.yaml",
        "--runs",
        tmp_path,
        "-q",
        code=0,
    )
    model = read_model(tmp_path / "data_for_testing" / "model.h5").body.model
    assert model is not None
    truth = {
        "x[k-2]": 0.6,
        "y[k-2]": -0.5,
        "x[k-1]*y[k-1]": 0.7,
        "x[k-2]*y[k-2]": -0.7,
        "y[k-1]^2": 0.2,
    }
    assert dict(zip(model.terms, model.theta, strict=True)) == pytest.approx(truth, abs=1e-6)


def test_identification_records_run_as_freely_as_the_peers(measured_data):
    """`test_shipped_studies` holds our figures against runs; the peer's are those of its file."""
    peer = json.loads(
        (measured_data / "system_identification" / "peer_sysidentpy.json").read_text()
    )["runs"]
    rows = page_table("identification", MEMORY)
    for name, run in (
        ("buck", "buck_deg2_lag2_n8"),
        ("motor_generator", "generator_dec500_deg2_lag2_n8"),
    ):
        row = numbers(rows[name])
        assert row["peer's"] == pytest.approx(peer[run]["rrse_free"], abs=1e-5)
        assert row["peer's one step"] == pytest.approx(peer[run]["rrse_one"], abs=1e-5)
        assert row["RRSE, free run"] == pytest.approx(row["peer's"], rel=0.005)
        assert row["RRSE, one step"] == pytest.approx(row["peer's one step"], rel=0.005)


def test_inner_reversals_are_shown_as_they_run():
    table = page_table("reversals", MEMORY)
    for name in REVERSALS:
        errors = numbers(table[name])
        assert errors == pytest.approx(
            {model: 100 * told for model, told in NRMSE[name].items()}, rel=0.01
        )


STUDIES = Path(__file__).parents[2] / "configs" / "identification"


def scores(mapmore, *arguments):
    result = mapmore("validate", *arguments, "--json", "-q", code=0)
    return {
        (row["model"], row["split"]): row
        for row in json.loads(result.stdout)["scores"]
        if row["curve"] == "all"
    }


def test_the_terms_of_the_tanks_run_as_the_page_says(tmp_path, mapmore, measured_data):
    told = numbers(page_table("tanks", MEMORY)["coefficients in free run"])
    terms = page_table("tanks_terms", MEMORY)
    assert len(terms) == told["terms"]
    again = f"dictionary=[{{terms: {json.dumps(list(terms))}}}]"
    settings = (
        "--set",
        again,
        "--set",
        f"fit.max_terms={len(terms)}",
    )
    rows = scores(mapmore, STUDIES / "cascaded_tanks.yaml", *settings, "--runs", tmp_path)
    assert rows["mapmore", "train"]["rmse"] == pytest.approx(
        told["RMSE, whole record, fitted"], abs=2e-3
    )
    memory = read_fit(tmp_path / "cascaded_tanks" / "fit.h5").memory
    assert memory is not None
    assert memory.held_out is not None
    assert memory.held_out[-1] == pytest.approx(told["RMSE, last quarter, held out"], abs=5e-3)
    coefficients = {term: float(row["coefficient"]) for term, row in terms.items()}
    assert dict(zip(memory.model.terms, memory.model.theta, strict=True)) == pytest.approx(
        coefficients, rel=0.02, abs=0.005
    )


def test_what_is_decided_in_free_run_runs_better():
    """On the last quarter, which was held out to choose the number of terms."""
    errors = {
        name: numbers(row)["RMSE, last quarter, held out"]
        for name, row in page_table("tanks", MEMORY).items()
    }
    assert errors["coefficients in free run"] == min(errors.values())


@pytest.mark.parametrize(
    "model", ["linear_one_step", "linear", pytest.param("mapmore", marks=pytest.mark.long)]
)
def test_the_oscillator_trained_on_little_runs_as_the_page_says(
    model, tmp_path, mapmore, measured_data
):
    told = numbers(page_table("bouc_wen", MEMORY)[model])["RRSE, free run, trained on 2048 samples"]
    linear = (
        "dictionary=[{lags: {of: [y, u], steps: [1, 2], constant: false}}]",
        "fit.max_terms=4",
    )
    changes = {
        "mapmore": (),
        "linear": linear,
        "linear_one_step": (*linear, "fit.criterion=one_step"),
    }[model]
    settings = [
        part
        for change in ("data.split.validate={last: 0.95}", "validate.against=[]", *changes)
        for part in ("--set", change)
    ]
    rows = scores(mapmore, STUDIES / "bouc_wen.yaml", *settings, "--runs", tmp_path)
    assert rows["mapmore", "validate"]["rrse"] == pytest.approx(told, rel=5e-3)
