"""The studies that are judged in free run: what docs/memory.md says of them, held against runs that are cheaper than theirs.

The search for the terms of the cascaded tanks takes half a minute, the training on 32 768 samples of the oscillator minutes. Here the terms
that the page names are fitted anew, and the oscillator is trained on 2048 samples. `python docs/memory_tables.py RUNS` makes all figures.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from page_tables import MEMORY, numbers, page_table

from mapmore_cli.storage.artefacts import read_fit

STUDIES = Path(__file__).parents[2] / "configs" / "identification"


def scores(mapmore: Callable[..., Any], *arguments: str) -> dict[tuple[str, str], dict[str, Any]]:
    result = mapmore("validate", *arguments, "--json", "-q")
    assert result.exit_code == 0, result.stderr
    return {(row["model"], row["split"]): row for row in json.loads(result.stdout)["scores"] if row["curve"] == "all"}


def test_the_terms_of_the_tanks_run_as_the_page_says(tmp_path: Path, mapmore: Callable[..., Any], measured_data: Path) -> None:
    told = numbers(page_table("tanks", MEMORY)["coefficients and terms in free run"])
    terms = page_table("tanks_terms", MEMORY)
    assert len(terms) == told["terms"]
    again = f"dictionary=[{{terms: {json.dumps(list(terms))}}}]"
    settings = ("--set", again, "--set", f"fit.max_terms={len(terms)}", "--set", "fit.select=one_step")
    rows = scores(mapmore, STUDIES / "cascaded_tanks.yaml", *settings, "--runs", tmp_path)
    assert rows["mapmore", "train"]["rmse"] == pytest.approx(told["RMSE, whole record, fitted"], abs=2e-3)
    memory = read_fit(tmp_path / "cascaded_tanks" / "fit.h5").memory
    assert memory is not None
    assert memory.held_out is not None
    assert memory.held_out[-1] == pytest.approx(told["RMSE, last quarter, held out"], abs=5e-3)
    coefficients = {term: float(row["coefficient"]) for term, row in terms.items()}
    assert dict(zip(memory.model.terms, memory.model.theta, strict=True)) == pytest.approx(coefficients, rel=0.02, abs=0.005)


def test_what_is_decided_in_free_run_runs_better() -> None:
    """On the last quarter, which was held out to choose the number of terms."""
    errors = {name: numbers(row)["RMSE, last quarter, held out"] for name, row in page_table("tanks", MEMORY).items()}
    assert errors["coefficients and terms in free run"] == min(errors.values())
    assert errors["coefficients in free run"] < errors["one step ahead"]


@pytest.mark.parametrize("model", ["linear_one_step", "linear", pytest.param("mapmore", marks=pytest.mark.long)])
def test_the_oscillator_trained_on_little_runs_as_the_page_says(
    model: str, tmp_path: Path, mapmore: Callable[..., Any], measured_data: Path
) -> None:
    told = numbers(page_table("bouc_wen", MEMORY)[model])["RRSE, free run, trained on 2048 samples"]
    linear = ("dictionary=[{lags: {of: [y, u], steps: [1, 2], constant: false}}]", "fit.max_terms=4")
    changes = {"mapmore": (), "linear": linear, "linear_one_step": (*linear, "fit.criterion=one_step")}[model]
    settings = [part for change in ("data.split.validate={last: 0.95}", "validate.against=[]", *changes) for part in ("--set", change)]
    rows = scores(mapmore, STUDIES / "bouc_wen.yaml", *settings, "--runs", tmp_path)
    assert rows["mapmore", "validate"]["rrse"] == pytest.approx(told, rel=5e-3)


def test_stops_of_the_fed_back_output_help_and_those_of_the_input_do_not() -> None:
    errors = {name: numbers(row)["RRSE, free run"] for name, row in page_table("bouc_wen", MEMORY).items()}
    assert errors["linear_stops"] < 0.9 * errors["linear"]
    assert errors["cubic_stops"] < 0.95 * errors["cubic"]
    assert errors["mapmore"] < 0.2 * errors["cubic_stops"]
    assert errors["linear_input_stops"] > 0.9 * errors["linear"]


@pytest.mark.parametrize("record", ["mr_damper", pytest.param("antagonist_pam", marks=pytest.mark.long)])
def test_friction_explains_what_the_page_says(record: str, tmp_path: Path, mapmore: Callable[..., Any], measured_data: Path) -> None:
    told = numbers(page_table("friction", MEMORY.with_name("benchmarks.md"))[record])["NRMSE"]
    rows = scores(mapmore, STUDIES / f"{record}.yaml", "--set", "validate.against=[]", "--runs", tmp_path)
    assert 100 * rows["mapmore", "validate"]["nrmse"] == pytest.approx(told, abs=0.02)


def test_the_page_has_the_oscillator_within_its_target() -> None:
    rows = {name: numbers(row)["RMSE"] for name, row in page_table("benchmarks", MEMORY.with_name("benchmarks.md")).items()}
    assert rows["Bouc-Wen"] < 2e-5
