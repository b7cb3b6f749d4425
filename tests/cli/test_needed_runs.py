"""Runs that are compared with other runs: these come first, in the same folder of runs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli_samples import scored_run, write_study

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.fitting.stage import Stage
from mapmore_cli.pipeline.needs import needed_runs
from mapmore_cli.spec.loader import load


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    """`bench.yaml`, and `rival_base.yaml` on the same data with a dictionary of its own."""
    bench = write_study(tmp_path)
    text = bench.read_text()
    bench.write_text(text.replace("against: [polynomial_2]", "against: [polynomial_2, {run: rival_base.yaml, as: line}]"))
    (tmp_path / "rival_base.yaml").write_text(text.replace("name: bench", "name: rival").replace("order: 3", "order: 1"))
    return bench, tmp_path / "rival_base.yaml"


def test_the_other_run_is_made_first_and_scored_beside(pair: tuple[Path, Path], tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    bench, rival = pair
    rmse, _ = scored_run(mapmore, bench, tmp_path / "runs")
    assert list(rmse) == ["mapmore", "polynomial_2", "line", "plane", "quadratic", "cubic"]
    own, _ = scored_run(mapmore, rival, tmp_path / "elsewhere")
    assert rmse["line"] == own["mapmore"]
    assert (tmp_path / "runs" / "rival" / "model.h5").is_file()
    assert not (tmp_path / "runs" / "rival" / "scores.json").exists()
    assert set(scored_run(mapmore, bench, tmp_path / "runs")[1].values()) == {"up-to-date"}


def test_a_comparison_leaves_the_other_run_as_it_is(pair: tuple[Path, Path], tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    """Whose settings have changed since is told, and scored anew once its own run has been done."""
    bench, rival = pair
    runs = tmp_path / "runs"
    before, _ = scored_run(mapmore, bench, runs)
    model = (runs / "rival" / "model.h5").read_bytes()
    rival.write_text(rival.read_text() + "fit: {max_terms: 2, tolerance: 0}\n")
    result = mapmore("run", bench, "--runs", runs)
    assert result.exit_code == 0
    assert "rival: its data or settings have changed since its model was made" in result.stderr
    assert "`mapmore run rival_base.yaml`" in result.stderr
    assert (runs / "rival" / "model.h5").read_bytes() == model
    assert scored_run(mapmore, bench, runs)[0] == before
    assert mapmore("run", rival, "--runs", runs, "-q").exit_code == 0
    after, stages = scored_run(mapmore, bench, runs)
    assert [name for name, status in stages.items() if status == "done"] == ["validate", "report"]
    assert after["mapmore"] == before["mapmore"]
    assert after["line"] != before["line"]


def test_show_says_what_is_older_than_its_sources(pair: tuple[Path, Path], tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    bench, _ = pair
    runs = tmp_path / "runs"
    assert mapmore("run", bench, "--runs", runs, "-q").exit_code == 0
    assert "out of date" not in mapmore("show", runs / "bench").stdout
    assert mapmore("fit", bench, "--runs", runs, "-q", "--set", "fit.max_terms=2").exit_code == 0
    assert "fuse is out of date: fit was done again since" in mapmore("show", runs / "bench").stdout
    assert "fuse is out of date" in mapmore("show", runs / "bench" / "model.h5").stdout
    assert json.loads(mapmore("show", runs / "bench", "--json").stdout)["stale"] == ["fuse", "validate", "report"]


def test_another_spec_of_the_same_name_is_refused(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    """Two specs, or two campaigns, that give a run one name would overwrite each other; a spec that was moved does not."""
    runs = tmp_path / "runs"
    for folder in ("spring", "autumn"):
        (tmp_path / folder).mkdir()
        write_study(tmp_path / folder)
    assert mapmore("ingest", tmp_path / "spring" / "bench.yaml", "--runs", runs, "-q").exit_code == 0
    result = mapmore("ingest", tmp_path / "autumn" / "bench.yaml", "--runs", runs, "-q")
    assert result.exit_code == 7
    assert "holds the run 'bench' of ../../spring/bench.yaml; this is a run of ../../autumn/bench.yaml" in result.stderr
    (tmp_path / "spring" / "bench.yaml").unlink()
    assert mapmore("ingest", tmp_path / "autumn" / "bench.yaml", "--runs", runs, "-q").exit_code == 0


@pytest.mark.usefixtures("batch_here")
def test_campaigns_do_not_share_a_name_for_different_runs(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    write_study(tmp_path)
    for name, terms in (("few", 1), ("many", 2), ("few_again", 1)):
        runs = f"[{{name: one, set: {{fit.max_terms: {terms}}}}}]"
        (tmp_path / f"{name}.yaml").write_text(f"campaign: {name}\nbase: bench.yaml\nruns: {runs}\n")
    batch = ("--runs", tmp_path / "runs", "-q", "--jobs", 1)
    assert mapmore("batch", tmp_path / "few.yaml", *batch).exit_code == 0
    assert mapmore("batch", tmp_path / "few_again.yaml", *batch).exit_code == 0
    (tmp_path / "few_again.yaml").write_text((tmp_path / "few_again.yaml").read_text().replace("terms: 1", "terms: 3"))
    assert mapmore("batch", tmp_path / "few_again.yaml", *batch).exit_code == 0
    result = mapmore("batch", tmp_path / "many.yaml", *batch)
    assert result.exit_code == 7
    assert "holds the run 'one' of ../../few_again.yaml; this is a run of ../../many.yaml" in result.stderr


def test_two_runs_may_be_compared_with_each_other(pair: tuple[Path, Path], tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    """Only models are needed, and these stand before the comparison: there is no circle."""
    bench, rival = pair
    rival.write_text(rival.read_text().replace("against: [polynomial_2]", "against: [{run: bench.yaml}]"))
    one, _ = scored_run(mapmore, bench, tmp_path / "runs")
    other, _ = scored_run(mapmore, rival, tmp_path / "runs")
    assert (one["mapmore"], one["line"]) == (other["bench"], other["mapmore"])


def test_models_that_need_each_other_are_refused(pair: tuple[Path, Path]) -> None:
    bench, rival = pair
    stage = Stage(
        "fit", 1, ("fit.h5",), reads=lambda spec: spec.fit, run=lambda _part, _workspace: None, needs=lambda _spec: ["bench.yaml"]
    )
    with pytest.raises(SpecError, match=r"bench\.yaml -> rival_base\.yaml -> bench\.yaml"):
        needed_runs(stage, load(rival), (bench.resolve(),))


def test_a_model_of_other_units_is_refused(pair: tuple[Path, Path], tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    bench, rival = pair
    rival.write_text(rival.read_text() + "units: {pressure: bar}\n")
    rival.write_text(rival.read_text().replace("at: [100, 200, 300]", "at: [1, 2, 3]").replace("pressure: [200]", "pressure: [2]"))
    result = mapmore("run", bench, "--runs", tmp_path / "runs")
    assert result.exit_code == 3
    assert "pressure" in result.stderr


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("{run: nowhere.yaml}", "nowhere.yaml"),
        ("{run: rival_base.yaml, model: sarosi}", "a `model`, a `run`"),
        ("{as: nothing}", "a `model`, a `run`"),
        ("{run: rival_base.yaml, method: levenberg_marquardt}", "method"),
    ],
)
def test_wrong_entries(pair: tuple[Path, Path], entry: str, words: str, tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    bench, _ = pair
    bench.write_text(bench.read_text().replace("{run: rival_base.yaml, as: line}", entry))
    result = mapmore("run", bench, "--runs", tmp_path / "runs")
    assert result.exit_code == 3
    assert words in result.stderr
