"""docs/memory.md says what the runs say: its tables fit each other, and some of the runs are done
again.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from statistics import median
from typing import Any

import pytest
from cli_samples import held_out
from page_tables import MEMORY, numbers, page_table
from test_shipped_studies import CONFIGS, NRMSE

from mapmore_cli.modelling.validation.repeatability import PARTS
from mapmore_cli.spec.campaign import Campaign, Entry, load_campaign
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


def campaign(name: str) -> tuple[Campaign, dict[str, Entry]]:
    """A shipped campaign, its runs by their names."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / f"{name}.yaml")
    return spec, {
        str(variant.name): entry for variant, entry in zip(spec.runs, entries, strict=True)
    }


def rows_of(table: str) -> dict[str, dict[str, float]]:
    """NRMSE in per cent of the runs of a campaign, by run and model."""
    _, runs = campaign(table)
    found = page_table(table, MEMORY)
    return {name: numbers(found[name]) for name in runs}


def nrmse(mapmore, entry: Entry, runs: Path) -> float:
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


@pytest.mark.parametrize("group", ["steps", "loops"])
def test_one_setting_keeps_the_limits_on_both_sets(group: str) -> None:
    """At most 12 terms: 4 % in the median, 10 % at worst; below every competitor in the median."""
    table = page_table("coiled", MEMORY)
    typical, worst = numbers(table[f"{group}: median"]), numbers(table[f"{group}: worst"])
    assert typical["mapmore"] <= 4
    assert worst["mapmore"] <= 10
    assert all(
        typical["mapmore"] < told
        for model, told in typical.items()
        if model not in ("mapmore", "repeatability")
    )


def test_the_parts_of_held_out_errors_add_up_and_drift_or_change_limits_most() -> None:
    rows = page_table("coiled_parts", MEMORY)
    shipped = {
        name: numbers(row)["shipped"]
        for name, row in page_table("coiled_models", MEMORY).items()
        if ":" not in name
    }
    limits = [row["limited by"] for row in rows.values()]
    for name, row in rows.items():
        parts = {part: numbers(row)[part] for part in PARTS}
        assert math.hypot(*parts.values()) == pytest.approx(numbers(row)["NRMSE"], rel=DIGITS)
        assert (row["limited by"], shipped[name]) == (
            max(parts, key=parts.__getitem__),
            pytest.approx(numbers(row)["NRMSE"], rel=0.05),
        )
    most = sum(limit in ("drift", "change") for limit in limits)
    assert f"the largest part in {most} of {len(rows)} records" in MEMORY.read_text(
        encoding="utf-8"
    )


def test_what_is_said_of_slower_states_stands_in_the_table() -> None:
    rows = {name: numbers(row) for name, row in page_table("coiled_models", MEMORY).items()}
    for group in ("steps", "loops"):
        of = [row["creep"] for name, row in rows.items() if name.startswith(f"{group}-")]
        assert (rows[f"{group}: median"]["creep"], rows[f"{group}: worst"]["creep"]) == (
            pytest.approx(median(of), rel=DIGITS),
            max(of),
        )
    steps, loops, worst = (
        rows[name]["creep"] for name in ("steps: median", "loops: median", "steps: worst")
    )
    assert f"to {steps} (steps) and {loops} % (loops), with {worst} % at worst" in MEMORY.read_text(
        encoding="utf-8"
    )


def test_what_is_said_of_jumps_stands_in_the_table() -> None:
    rows = [numbers(row) for row in page_table("uncut", MEMORY).values()]
    (uncut, cut) = (sorted(row[name] for row in rows) for name in ("uncut", "cut"))
    said = (
        f"out of four records. With them the error is {uncut[0]} to {uncut[-1]} %, without "
        f"{cut[0]} to {cut[-1]}."
    )
    assert (len(rows), said in MEMORY.read_text(encoding="utf-8")) == (4, True)


def test_what_is_said_of_other_loads_stands_in_the_table() -> None:
    text = MEMORY.read_text(encoding="utf-8")
    between, beyond = (
        numbers(page_table("coiled_loads", MEMORY)[f"{where}: median"])
        for where in ("between", "beyond")
    )
    assert (
        f"{between['mapmore']} % in the median with it, {between['without_load']} without." in text
    )
    assert f"Beyond them it does: {beyond['mapmore']} and {beyond['without_load']}." in text


def test_the_campaign_has_every_record_and_one_fragment() -> None:
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
def test_a_run_gives_what_the_page_says(
    table: str, name: str, tmp_path: Path, mapmore, measured_data: Path
) -> None:
    _, runs = campaign(table)
    told = (
        numbers(page_table("uncut", MEMORY)[name])["cut"]
        if name == FEWER
        else rows_of(table)[name]["mapmore"]
    )
    assert nrmse(mapmore, runs[name], tmp_path) == pytest.approx(told, rel=0.02)


def test_the_true_terms_of_the_simulated_record(
    tmp_path: Path, mapmore, measured_data: Path
) -> None:
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


def test_identification_records_run_as_freely_as_the_peers(measured_data: Path) -> None:
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


def test_inner_reversals_are_shown_as_they_run() -> None:
    table = page_table("reversals", MEMORY)
    for name in REVERSALS:
        errors = numbers(table[name])
        assert errors == pytest.approx(
            {model: 100 * told for model, told in NRMSE[name].items()}, rel=0.01
        )
        assert all(errors["mapmore"] < told for model, told in errors.items() if model != "mapmore")
    own, loops, plays = (
        [table[name][model] for name in REVERSALS]
        for model in ("mapmore", "rise_and_fall", "prandtl_ishlinskii")
    )
    said = (
        "errs by {} % (McKibben) and {} % (Peano), `rise_and_fall` by {} and {}, "
        "`prandtl_ishlinskii` by {} and {}."
    )
    assert said.format(*own, *loops, *plays) in MEMORY.read_text(encoding="utf-8")


STUDIES = Path(__file__).parents[2] / "configs" / "identification"


def scores(mapmore, *arguments: str) -> dict[tuple[str, str], dict[str, Any]]:
    result = mapmore("validate", *arguments, "--json", "-q", code=0)
    return {
        (row["model"], row["split"]): row
        for row in json.loads(result.stdout)["scores"]
        if row["curve"] == "all"
    }


def test_the_terms_of_the_tanks_run_as_the_page_says(
    tmp_path: Path, mapmore, measured_data: Path
) -> None:
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


def test_what_is_decided_in_free_run_runs_better() -> None:
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
    model: str, tmp_path: Path, mapmore, measured_data: Path
) -> None:
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


def test_stops_of_the_fed_back_output_help_and_those_of_the_input_do_not() -> None:
    errors = {
        name: numbers(row)["RRSE, free run"] for name, row in page_table("bouc_wen", MEMORY).items()
    }
    assert errors["linear_stops"] < 0.9 * errors["linear"]
    assert errors["cubic_stops"] < 0.95 * errors["cubic"]
    assert errors["mapmore"] < 0.2 * errors["cubic_stops"]
    assert errors["linear_input_stops"] > 0.9 * errors["linear"]
    text = MEMORY.read_text(encoding="utf-8")
    assert (
        "{:.4f} with `wen_stiffening`, {:.4f} with `wen`, {:.4f} for".format(
            *(errors[name] for name in ("mapmore", "wen", "linear"))
        )
        in text
    )
    assert (
        f"the linear model ({errors['linear_stops']:.4f}), stops of the input do not "
        f"({errors['linear_input_stops']:.4f})" in text
    )


@pytest.mark.parametrize(
    "record", ["mr_damper", pytest.param("antagonist_pam", marks=pytest.mark.long)]
)
def test_friction_explains_what_the_page_says(
    record: str, tmp_path: Path, mapmore, measured_data: Path
) -> None:
    told = numbers(page_table("friction", MEMORY.with_name("benchmarks.md"))[record])["NRMSE"]
    rows = scores(
        mapmore, STUDIES / f"{record}.yaml", "--set", "validate.against=[]", "--runs", tmp_path
    )
    assert 100 * rows["mapmore", "validate"]["nrmse"] == pytest.approx(told, abs=0.02)


def test_the_page_has_the_oscillator_within_its_target() -> None:
    rows = {
        name: numbers(row)["RMSE"]
        for name, row in page_table("benchmarks", MEMORY.with_name("benchmarks.md")).items()
    }
    assert rows["Bouc-Wen"] < 2e-5
