"""Competitors that are the run's own spec with other settings, and other runs: these come first, in
the same folder of runs.
"""

from pathlib import Path

import pytest
from cli_samples import OWN, by_place, change_forces, edit, options, scored_run, write_study

from mapmore_cli.storage.run_record import load_origin


def against(spec, entry):
    """The spec, also compared with the entry."""
    edit(spec, "against: [polynomial_2]", f"against: [polynomial_2, {entry}]")
    return spec


def test_a_variation_scores_as_a_run_with_these_settings_does(study, mapmore):
    varied = against(study, "{set: {fit.max_terms: 2, fuse: {z_s: 0.4}}, as: two}")
    rmse, _ = scored_run(mapmore, varied)
    assert list(rmse) == ["mapmore", "polynomial_2", "two", "plane", "quadratic", "cubic"]
    folder = Path("runs", "bench.two")
    assert (folder / "model.h5").is_file()
    assert not (folder / "validate.h5").exists()
    assert set(scored_run(mapmore, varied)[1].values()) == {"up-to-date"}
    varied = varied.rename(varied.with_name("renamed.yaml"))
    scored_run(mapmore, varied)
    assert load_origin(folder).spec == "../../renamed.yaml"
    settings = options("fit.max_terms=2", "fuse={z_s: 0.4}", "validate={}", "name=alone")
    alone, _ = scored_run(mapmore, varied, *settings)
    assert rmse["two"] == alone["mapmore"]
    assert rmse["two"] != rmse["mapmore"]


def test_a_variation_may_be_a_formula_or_lack_the_backbone(study, mapmore):
    formula = "{set: {model: {type: literature, name: polynomial_2}}, as: formula}"
    against(study, f"{{set: {{model.backbone: null}}, as: bare}}, {formula}")
    rmse, _ = scored_run(mapmore, study, *options("model.backbone=polynomial_2"))
    bare, _ = scored_run(mapmore, study, *options("validate={}", "name=bare"))
    assert rmse["bare"] == bare["mapmore"]
    assert rmse["formula"] == pytest.approx(rmse["polynomial_2"])


def test_repeated_measurements_get_rows_of_their_own(copied, tmp_path, mapmore, document):
    """Without a repeat there is none; with one, the shift between both is what is told, over the
    models' normaliser.
    """
    spec, _ = copied
    rmse, stages = scored_run(mapmore, spec)
    assert set(stages.values()) == {"up-to-date"}
    assert "repeatability" not in rmse
    for level in (100, 200, 300):
        log = tmp_path / f"bench_{level}.csv"
        change_forces(log, lambda force: force + 5, log.with_stem(f"{log.stem}_again"))
    rows = by_place(document("run", spec, "-q"))
    assert ("repeatability", "train", "all") in rows
    floor, own = rows["repeatability", *OWN[1:]], rows[OWN]
    assert floor["rmse"] == pytest.approx(5.0, rel=1e-6)
    for key in ("normaliser", "normaliser_name"):
        assert floor[key] == own[key]
    assert floor["n"] <= own["n"]
    assert "repeatability" in Path("runs", "bench", "report", "index.html").read_text()


@pytest.fixture
def pair(study):
    """`bench.yaml`, and `rival_base.yaml` on the same data with a dictionary of its own."""
    text = study.read_text()
    rival = study.with_name("rival_base.yaml")
    rival.write_text(text.replace("name: bench", "name: rival").replace("order: 3", "order: 1"))
    return against(study, "{run: rival_base.yaml, as: line}"), rival


def test_the_other_run_is_made_first_and_scored_beside(pair, mapmore):
    bench, rival = pair
    rmse, _ = scored_run(mapmore, bench)
    assert list(rmse) == ["mapmore", "polynomial_2", "line", "plane", "quadratic", "cubic"]
    assert Path("runs", "rival", "model.h5").is_file()
    assert not Path("runs", "rival", "scores.json").exists()
    assert set(scored_run(mapmore, bench)[1].values()) == {"up-to-date"}
    own, _ = scored_run(mapmore, rival, "--runs", "elsewhere")
    assert rmse["line"] == own["mapmore"]


def test_a_comparison_leaves_the_other_run_as_it_is(pair, mapmore):
    """Whose settings have changed since is told, and scored anew once its own run has been done."""
    bench, rival = pair
    before, _ = scored_run(mapmore, bench)
    file = Path("runs", "rival", "model.h5")
    model = file.read_bytes()
    rival.write_text(rival.read_text() + "fit: {max_terms: 2, tolerance: 0}\n")
    told = "rival: its data or settings have changed since its model was made"
    mapmore("run", bench, code=0, says=[told, "`mapmore run rival_base.yaml`"])
    assert file.read_bytes() == model
    assert scored_run(mapmore, bench)[0] == before
    mapmore("run", rival, "-q", code=0)
    after, stages = scored_run(mapmore, bench)
    assert [name for name, status in stages.items() if status == "done"] == ["validate", "report"]
    assert after["mapmore"] == before["mapmore"]
    assert after["line"] != before["line"]


def test_show_says_what_is_older_than_its_sources(pair, mapmore, document):
    bench, _ = pair
    run = Path("runs", "bench")
    mapmore("run", bench, "-q", code=0)
    assert "out of date" not in mapmore("show", run).stdout
    mapmore("fit", bench, "-q", "--set", "fit.max_terms=2", code=0)
    assert "fuse is out of date, because fit was repeated since" in mapmore("show", run).stdout
    assert "fuse is out of date" in mapmore("show", run / "model.h5").stdout
    assert document("show", run)["stale"] == ["fuse", "validate", "report"]


def test_another_spec_of_the_same_name_is_refused(tmp_path, mapmore):
    """Two specs, or two campaigns, that give a run one name would overwrite each other; a spec that
    was moved does not.
    """
    for folder in ("spring", "autumn"):
        (tmp_path / folder).mkdir()
        write_study(tmp_path / folder)
    mapmore("ingest", tmp_path / "spring" / "bench.yaml", "-q", code=0)
    result = mapmore("ingest", tmp_path / "autumn" / "bench.yaml", "-q", code=7)
    assert (
        "contains the run 'bench' of ../../spring/bench.yaml, "
        "but this run of the same name is of ../../autumn/bench.yaml" in result.stderr
    )
    (tmp_path / "spring" / "bench.yaml").unlink()
    mapmore("ingest", tmp_path / "autumn" / "bench.yaml", "-q", code=0)


def test_runs_that_are_built_on_each_other_are_refused(pair, tmp_path, mapmore):
    """Also where one of them is only compared: its model needs what it is built on."""
    bench, rival = pair
    rival.write_text(f"{rival.read_text()}needs: {{static: bench.yaml}}\n")
    circle = "bench.yaml -> rival_base.yaml -> bench.yaml"
    for more in ((), ("--explain",)):
        mapmore("run", bench, *more, code=3, says=circle)


@pytest.mark.parametrize(
    ("entry", "code", "words"),
    [
        ("{set: {fit.max_term: 2}, as: two}", 3, ["competitor `two`", "did you mean `max_terms`?"]),
        ("{set: {segment.strain.count: 500}, as: two}", 4, "bench.two: ingest"),
        ("{run: nowhere.yaml}", 3, "nowhere.yaml"),
    ],
)
def test_what_is_wrong_with_another_run_is_told_by_its_name(pair, entry, code, words, mapmore):
    """Entries that cannot be are in `study/slips.txt`."""
    bench, _ = pair
    bench.write_text(bench.read_text().replace("{run: rival_base.yaml, as: line}", entry))
    mapmore("run", bench, code=code, says=words)
