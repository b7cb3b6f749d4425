"""Competitors that are the run's own spec with other settings, and other runs: these come first, in
the same folder of runs.
"""

from __future__ import annotations

import json

import pytest
from cli_samples import change_forces, scored_run, write_study

VARIATION = "{set: {fit.max_terms: 2, fuse: {z_s: 0.4}}, as: two}"


@pytest.fixture
def varied(tmp_path):
    """`bench.yaml`, compared with itself with two terms."""
    return against(write_study(tmp_path), VARIATION)


def against(spec, entry):
    spec.write_text(
        spec.read_text().replace("against: [polynomial_2]", f"against: [polynomial_2, {entry}]")
    )
    return spec


def test_a_variation_scores_as_a_run_with_these_settings_does(varied, tmp_path, mapmore):
    rmse, _ = scored_run(mapmore, varied, tmp_path / "runs")
    assert list(rmse) == ["mapmore", "polynomial_2", "two", "plane", "quadratic", "cubic"]
    alone, _ = scored_run(
        mapmore,
        varied,
        tmp_path / "alone",
        "--set",
        "fit.max_terms=2",
        "--set",
        "fuse={z_s: 0.4}",
        "--set",
        "validate={}",
    )
    assert rmse["two"] == alone["mapmore"]
    assert rmse["two"] != rmse["mapmore"]
    assert (tmp_path / "runs" / "bench.two" / "model.h5").is_file()
    assert not (tmp_path / "runs" / "bench.two" / "validate.h5").exists()
    assert set(scored_run(mapmore, varied, tmp_path / "runs")[1].values()) == {"up-to-date"}


def test_a_change_of_the_spec_changes_the_variation(varied, tmp_path, mapmore):
    before, _ = scored_run(mapmore, varied, tmp_path / "runs")
    after, stages = scored_run(
        mapmore,
        varied,
        tmp_path / "runs",
        "--set",
        "fit.max_terms=3",
        "--set",
        "segment.strain.count=1",
    )
    assert after["two"] != before["two"]
    assert stages["ingest"] == "up-to-date"
    varied.write_text(varied.read_text().replace("fit.max_terms: 2", "fit.max_terms: 1"))
    again, stages = scored_run(mapmore, varied, tmp_path / "runs")
    assert again["mapmore"] == before["mapmore"]
    assert again["two"] != before["two"]


def test_overrides_of_the_run_hold_for_its_variations(varied, tmp_path, mapmore):
    scored_run(
        mapmore, varied, tmp_path / "runs", "--set", "name=renamed", "--set", "fit.scaling=none"
    )
    text = (tmp_path / "runs" / "renamed.two" / "experiment.yaml").read_text()
    assert "name: renamed.two" in text
    assert "scaling: none" in text
    assert "max_terms: 2" in text


def test_a_variation_may_be_a_formula_or_lack_the_backbone(tmp_path, mapmore):
    formula = "{set: {model: {type: literature, name: polynomial_2}}, as: formula}"
    spec = against(write_study(tmp_path), f"{{set: {{model.backbone: null}}, as: bare}}, {formula}")
    rmse, _ = scored_run(mapmore, spec, tmp_path / "runs", "--set", "model.backbone=polynomial_2")
    bare, _ = scored_run(mapmore, spec, tmp_path / "bare", "--set", "validate={}")
    assert rmse["bare"] == bare["mapmore"]
    assert rmse["formula"] == pytest.approx(rmse["polynomial_2"])


def test_a_formula_takes_the_diameter_of_the_muscle(tmp_path, mapmore):
    """As a competitor and as the run's own model; twice the area of a braid cannot give the same
    force.
    """
    spec = against(write_study(tmp_path), "tondu_lopez_fixed_area")
    assert "needs the diameter" in mapmore("check", spec).stderr
    rmse, _ = scored_run(mapmore, spec, tmp_path / "runs", "--set", "muscle.diameter=0.03")
    wider, _ = scored_run(mapmore, spec, tmp_path / "runs", "--set", "muscle.diameter=0.06")
    own = (
        "--set",
        "model={type: literature, name: tondu_lopez_fixed_area}",
        "--set",
        "segment={}",
        "--set",
        "dictionary=[]",
    )
    alone, _ = scored_run(mapmore, spec, tmp_path / "own", "--set", "muscle.diameter=0.03", *own)
    assert rmse["tondu_lopez_fixed_area"] != wider["tondu_lopez_fixed_area"]
    assert alone["mapmore"] == pytest.approx(rmse["tondu_lopez_fixed_area"], rel=1e-12)


def test_a_formula_may_start_from_published_values(tmp_path, mapmore):
    entry = (
        "{model: sarosi, method: levenberg_marquardt, starts: published, as: from_published}, "
        "sarosi"
    )
    rmse, _ = scored_run(mapmore, against(write_study(tmp_path), entry), tmp_path / "runs")
    assert rmse["from_published"] == pytest.approx(rmse["sarosi"], rel=0.2)


def test_repeated_measurements_get_rows_of_their_own(copied, tmp_path, mapmore):
    """Without a repeat there is none; with one, the shift between both is what is told, over the
    models' normaliser.
    """
    spec, runs = copied
    rmse, stages = scored_run(mapmore, spec, runs)
    assert set(stages.values()) == {"up-to-date"}
    assert "repeatability" not in rmse
    for level in (100, 200, 300):
        change_forces(
            tmp_path / f"bench_{level}.csv",
            lambda force: force + 5,
            tmp_path / f"bench_{level}_again.csv",
        )
    result = mapmore("run", spec, "--runs", runs, "--json", "-q")
    rows = {
        (r["model"], r["split"]): r
        for r in json.loads(result.stdout)["scores"]
        if r["curve"] == "all"
    }
    floor, own = rows["repeatability", "validate"], rows["mapmore", "validate"]
    assert floor["rmse"] == pytest.approx(5.0, rel=1e-6)
    assert (floor["normaliser"], floor["normaliser_name"]) == (
        own["normaliser"],
        own["normaliser_name"],
    )
    assert floor["n"] <= own["n"]
    assert ("repeatability", "train") in rows
    assert "repeatability" in (tmp_path / "runs" / "bench" / "report" / "index.html").read_text()


def test_the_resolved_spec_of_a_run_runs_again(varied, tmp_path, mapmore):
    """`experiment.yaml` lies in another folder than its recordings, and means the same ones."""
    runs = tmp_path / "deep" / "runs"
    first, _ = scored_run(mapmore, varied, runs)
    again, _ = scored_run(mapmore, runs / "bench" / "experiment.yaml", tmp_path / "again")
    assert again == first
    scores = [
        (folder / "bench" / "scores.json").read_bytes() for folder in (runs, tmp_path / "again")
    ]
    assert scores[0] == scores[1]
    before = (runs / "bench" / "experiment.yaml").read_bytes()
    scored_run(mapmore, runs / "bench" / "experiment.yaml", runs)
    assert (runs / "bench" / "experiment.yaml").read_bytes() == before


@pytest.fixture
def pair(tmp_path):
    """`bench.yaml`, and `rival_base.yaml` on the same data with a dictionary of its own."""
    bench = write_study(tmp_path)
    text = bench.read_text()
    bench.write_text(
        text.replace(
            "against: [polynomial_2]", "against: [polynomial_2, {run: rival_base.yaml, as: line}]"
        )
    )
    (tmp_path / "rival_base.yaml").write_text(
        text.replace("name: bench", "name: rival").replace("order: 3", "order: 1")
    )
    return bench, tmp_path / "rival_base.yaml"


def test_the_other_run_is_made_first_and_scored_beside(pair, tmp_path, mapmore):
    bench, rival = pair
    rmse, _ = scored_run(mapmore, bench, tmp_path / "runs")
    assert list(rmse) == ["mapmore", "polynomial_2", "line", "plane", "quadratic", "cubic"]
    own, _ = scored_run(mapmore, rival, tmp_path / "elsewhere")
    assert rmse["line"] == own["mapmore"]
    assert (tmp_path / "runs" / "rival" / "model.h5").is_file()
    assert not (tmp_path / "runs" / "rival" / "scores.json").exists()
    assert set(scored_run(mapmore, bench, tmp_path / "runs")[1].values()) == {"up-to-date"}


def test_a_comparison_leaves_the_other_run_as_it_is(pair, tmp_path, mapmore):
    """Whose settings have changed since is told, and scored anew once its own run has been done."""
    bench, rival = pair
    runs = tmp_path / "runs"
    before, _ = scored_run(mapmore, bench, runs)
    model = (runs / "rival" / "model.h5").read_bytes()
    rival.write_text(rival.read_text() + "fit: {max_terms: 2, tolerance: 0}\n")
    result = mapmore("run", bench, "--runs", runs, code=0)
    assert "rival: its data or settings have changed since its model was made" in result.stderr
    assert "`mapmore run rival_base.yaml`" in result.stderr
    assert (runs / "rival" / "model.h5").read_bytes() == model
    assert scored_run(mapmore, bench, runs)[0] == before
    mapmore("run", rival, "--runs", runs, "-q", code=0)
    after, stages = scored_run(mapmore, bench, runs)
    assert [name for name, status in stages.items() if status == "done"] == ["validate", "report"]
    assert after["mapmore"] == before["mapmore"]
    assert after["line"] != before["line"]


def test_show_says_what_is_older_than_its_sources(pair, tmp_path, mapmore):
    bench, _ = pair
    runs = tmp_path / "runs"
    mapmore("run", bench, "--runs", runs, "-q", code=0)
    assert "out of date" not in mapmore("show", runs / "bench").stdout
    mapmore("fit", bench, "--runs", runs, "-q", "--set", "fit.max_terms=2", code=0)
    assert "fuse is out of date: fit was done again since" in mapmore("show", runs / "bench").stdout
    assert "fuse is out of date" in mapmore("show", runs / "bench" / "model.h5").stdout
    assert json.loads(mapmore("show", runs / "bench", "--json").stdout)["stale"] == [
        "fuse",
        "validate",
        "report",
    ]


def test_another_spec_of_the_same_name_is_refused(tmp_path, mapmore):
    """Two specs, or two campaigns, that give a run one name would overwrite each other; a spec that
    was moved does not.
    """
    runs = tmp_path / "runs"
    for folder in ("spring", "autumn"):
        (tmp_path / folder).mkdir()
        write_study(tmp_path / folder)
    mapmore("ingest", tmp_path / "spring" / "bench.yaml", "--runs", runs, "-q", code=0)
    result = mapmore("ingest", tmp_path / "autumn" / "bench.yaml", "--runs", runs, "-q", code=7)
    assert (
        "holds the run 'bench' of ../../spring/bench.yaml; this is a run of ../../autumn/bench.yaml"
        in result.stderr
    )
    (tmp_path / "spring" / "bench.yaml").unlink()
    mapmore("ingest", tmp_path / "autumn" / "bench.yaml", "--runs", runs, "-q", code=0)


@pytest.mark.usefixtures("batch_here")
def test_campaigns_do_not_share_a_name_for_different_runs(tmp_path, mapmore):
    write_study(tmp_path)
    for name, terms in (("few", 1), ("many", 2), ("few_again", 1)):
        runs = f"[{{name: one, set: {{fit.max_terms: {terms}}}}}]"
        (tmp_path / f"{name}.yaml").write_text(
            f"campaign: {name}\nbase: bench.yaml\nruns: {runs}\n"
        )
    batch = ("--runs", tmp_path / "runs", "-q", "--jobs", 1)
    mapmore("batch", tmp_path / "few.yaml", *batch, code=0)
    mapmore("batch", tmp_path / "few_again.yaml", *batch, code=0)
    (tmp_path / "few_again.yaml").write_text(
        (tmp_path / "few_again.yaml").read_text().replace("terms: 1", "terms: 3")
    )
    mapmore("batch", tmp_path / "few_again.yaml", *batch, code=0)
    result = mapmore("batch", tmp_path / "many.yaml", *batch, code=7)
    assert (
        "holds the run 'one' of ../../few_again.yaml; this is a run of ../../many.yaml"
        in result.stderr
    )


def test_two_runs_may_be_compared_with_each_other(pair, tmp_path, mapmore):
    """Only models are needed, and these stand before the comparison: there is no circle."""
    bench, rival = pair
    rival.write_text(
        rival.read_text().replace("against: [polynomial_2]", "against: [{run: bench.yaml}]")
    )
    one, _ = scored_run(mapmore, bench, tmp_path / "runs")
    other, _ = scored_run(mapmore, rival, tmp_path / "runs")
    assert (one["mapmore"], one["line"]) == (other["bench"], other["mapmore"])


def test_runs_that_are_built_on_each_other_are_refused(pair, tmp_path, mapmore):
    """Also where one of them is only compared: its model needs what it is built on."""
    bench, rival = pair
    rival.write_text(f"{rival.read_text()}needs: {{static: bench.yaml}}\n")
    circle = "bench.yaml -> rival_base.yaml -> bench.yaml"
    for more in ((), ("--explain",)):
        mapmore("run", bench, "--runs", tmp_path / "runs", *more, code=3, says=circle)


def test_a_model_of_other_units_is_refused(pair, tmp_path, mapmore):
    bench, rival = pair
    rival.write_text(rival.read_text() + "units: {pressure: bar}\n")
    rival.write_text(
        rival.read_text()
        .replace("at: [100, 200, 300]", "at: [1, 2, 3]")
        .replace("pressure: [200]", "pressure: [2]")
    )
    mapmore("run", bench, "--runs", tmp_path / "runs", code=3, says="pressure")


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("{set: {fit.max_terms: 2}}", ["need a name", "as: one_term"]),
        ("{set: {fit.max_terms: 2}, as: two, method: levenberg_marquardt}", "method"),
        ("{set: {fit.max_terms: 2}, as: two, model: sarosi}", "keys `set`"),
        ("{set: {fit.max_terms: 2}, as: repeatability}", "named `repeatability`"),
        (
            "{set: {fit.max_term: 2}, as: two}",
            ["as `two`", "max_term", "did you mean `max_terms`?"],
        ),
        ("{set: {segment.strain.count: 500}, as: two}", "bench.two: ingest"),
        ("{run: nowhere.yaml}", "nowhere.yaml"),
        ("{run: rival_base.yaml, model: sarosi}", "a `model`, a `run`"),
        ("{as: nothing}", "a `model`, a `run`"),
        ("{run: rival_base.yaml, method: levenberg_marquardt}", "method"),
    ],
)
def test_wrong_entries(pair, entry, words, tmp_path, mapmore):
    bench, _ = pair
    bench.write_text(bench.read_text().replace("{run: rival_base.yaml, as: line}", entry))
    mapmore("run", bench, "--runs", tmp_path / "runs", code=4 if "500" in entry else 3, says=words)
    if "max_term:" in entry:
        mapmore("check", bench, code=3, says=words)
