"""`model: {type: auto}`: the structure is searched on training data alone, kept, and told."""

from pathlib import Path

import numpy as np
import pytest
from cli_samples import OWN, by_place, page_of, write_lines
from common import dataset_of
from pydantic_core import to_json

from mapmore_cli.annexes.search import stage
from mapmore_cli.cli.views import verdict_lines
from mapmore_cli.domain.results import Search, Tried
from mapmore_cli.fitting.kinds.choices import model_choices
from mapmore_cli.study.checks import competitors
from mapmore_cli.study.loader import load

pytestmark = pytest.mark.usefixtures("fewer_families")

SPEC = """\
schema_version: 1
name: bare
data:
  files: [bare.csv]
  columns: {pressure: {column: P, unit: kPa}, strain: {column: eps}, force: {column: F, unit: N}}
  levels: {of: pressure, at: [100, 200, 300, 400, 500]}
  split: {validate: {pressure: [300]}}
target: static
report: {figures: [], formats: [csv, html]}
"""


def write_bare(folder, permuted=False):
    """Sixty points of a cubic surface with a little noise; the held-out forces may be in another
    order.
    """
    rng = np.random.default_rng(3)
    rows = []
    for level in (100, 200, 300, 400, 500):
        strain = np.linspace(0.0, 0.2, 12)
        force = (
            level * (1 - 4 * strain)
            + 900 * strain**3 * level / 10
            - 30 * strain
            + rng.normal(0, 0.05, 12)
        )
        if permuted and level == 300:
            force = force[::-1]
        rows += [f"{level},{e:.5f},{f:.4f}" for e, f in zip(strain, force, strict=True)]
    folder.mkdir(exist_ok=True)
    write_lines(folder / "bare.csv", "P,eps,F", *rows)
    (folder / "bare.yaml").write_text(SPEC)
    return folder / "bare.yaml"


def test_a_minimal_spec_is_a_study_and_what_it_found_repeats_without_a_search(
    tmp_path, mapmore, document
):
    spec = write_bare(tmp_path)
    found = document("run", spec, "-q")
    assert found["stages"]["search"] == "done"
    assert found["search"]["found"] in {one["structure"] for one in found["search"]["tried"]}
    assert by_place(found)[OWN]["nrmse"] < 0.005
    page = page_of("bare")
    assert "Structures that were tried on training data" in page
    assert found["search"]["found"] in page

    again = document("run", "runs/bare/found.yaml", "--runs", "other", "-q")
    assert "search" not in again["stages"]
    assert again["scores"] == found["scores"]

    kept = document("run", spec, "-q")
    assert set(kept["stages"].values()) == {"up-to-date"}
    reasons = document("run", spec, "--explain", "-q")["stages"]
    assert list(reasons) == ["ingest", "search", "segment", "fit", "fuse", "validate", "report"]
    assert set(reasons.values()) == {None}

    # the spec that was found stays for a spec that reads it
    spec.write_text("extends: runs/bare/found.yaml\ndata: {files: [bare.csv]}\n")
    mapmore("ingest", spec, code=0)
    assert all(Path("runs", "bare", name).is_file() for name in ("search.json", "found.yaml"))


def formula(name, excess):
    sections = {"model": {"type": "literature", "name": name}}
    return Tried("formula", f"formula {name}", sections, excess=excess)


TRIED = (
    Tried("simple", "plane", {"dictionary": [{"polynomial": {"of": ["strain"], "order": 1}}]}),
    formula("sarosi_hinged", 0.2),
    formula("sarosi", 0.1),
    *(Tried("black box", words, {}) for words in ("gaussian process", "gradient boosting")),
)
BOXES = ["gaussian_process", "gradient_boosting"]
SPLIT = "split: {validate: {pressure: [300]}}"
IN_TURN = "split: {leave_one_level_out: true}"


@pytest.mark.parametrize(
    ("chosen", "more", "split", "installed", "expected"),
    [
        (0, "", SPLIT, True, ["sarosi", *BOXES]),
        (2, "", SPLIT, True, BOXES),
        (0, "", SPLIT, False, ["sarosi"]),
        (0, "", IN_TURN, True, ["sarosi_hinged", "sarosi"]),
        (0, "", "", True, ["sarosi"]),
        (0, "validate: {against: []}", SPLIT, True, []),
        (0, "validate: {against: [kerscher]}", SPLIT, True, ["kerscher"]),
    ],
)
def test_formulas_and_black_boxes_of_the_search_compete_unless_the_spec_names_competitors(
    chosen, more, split, installed, expected, tmp_path, monkeypatch
):
    for module in (stage, competitors):
        monkeypatch.setattr(module, "find_spec", lambda _name: installed or None)
    spec = write_bare(tmp_path)
    spec.write_text(SPEC.replace(SPLIT, split) + more)
    result = Search("bare", "force", "", "", 1.0, TRIED, 0, chosen)
    (tmp_path / "search.json").write_bytes(to_json(result, inf_nan_mode="strings"))
    found = stage.with_found(load(spec), tmp_path).spec
    assert found.validation.against == expected


def test_a_budget_that_cut_the_list_is_told(tmp_path, mapmore, monkeypatch):
    from mapmore_cli.annexes.search import searching

    monkeypatch.setattr(
        searching, "shared_out", lambda work, items, *_: [work(item) for item in items]
    )
    result = mapmore("tune", write_bare(tmp_path), "--budget", "1 ms")
    assert "the budget of 0.001 s ended before" in result.stderr
    mapmore("run", tmp_path / "runs/bare/found.yaml", "--runs", tmp_path / "other", "-q", code=0)


def plain_models_only(monkeypatch):
    from mapmore_cli.annexes.search import searching

    every = searching.offered_structures
    monkeypatch.setattr(
        searching,
        "offered_structures",
        lambda *of: [one for one in every(*of) if one.family == "simple"],
    )


def test_every_level_is_left_out_of_the_search_as_well(tmp_path, mapmore, monkeypatch):
    """Of scores and of intervals: no structure and no coefficient has seen the forces at 300 kPa,
    which may stand in another order; run without its search, the spec says that it has.
    """
    from mapmore_cli.fitting import left_out

    made, whole = list[str](), left_out.refit
    plain_models_only(monkeypatch)

    def watched(choices, dataset, *more):
        if all(curve.held_out.all() for curve in dataset.curves if curve.level == 300):
            model = whole(choices, dataset, *more)
            made.append(repr((choices, model.body)))
            return model
        return whole(choices, dataset, *more)

    monkeypatch.setattr(left_out, "refit", watched)
    found = []
    for name, permuted in (("one", False), ("two", True)):
        spec = write_bare(tmp_path / name, permuted)
        spec.write_text(
            spec.read_text().replace(SPLIT, IN_TURN)
            + "validate: {intervals: true, against: [plane]}\n"
        )
        made.clear()
        runs = tmp_path / name / "runs"
        mapmore("validate", spec, "--runs", runs, "-q", code=0)
        assert verdict_lines(runs / "bare")[0].startswith("mapmore predicts")
        found.append(sorted(made))
    assert len(found[0]) == 2
    assert found[0] == found[1]
    mapmore("validate", runs / "bare/found.yaml", "--runs", "other", "-q", code=0)
    (verdict,) = verdict_lines(Path("other/bare"))
    assert verdict.startswith("the structure was chosen with all levels, so that errors on new")
    assert "; mapmore predicts" in verdict


def test_of_many_levels_several_share_a_search_without_all_of_them(monkeypatch, tmp_path):
    from mapmore_cli.fitting import left_out

    out, chosen = list[int](), model_choices(load(write_bare(tmp_path)).spec)

    def searched(dataset):
        out.append(sum(curve.held_out.all() for curve in dataset.curves))
        return chosen

    monkeypatch.setattr(left_out, "_searching_again", lambda _run: searched)
    numbers = range(left_out.MOST_SEARCHES + 2)
    data = dataset_of(*({"y": np.arange(5.0)} for _ in numbers))
    folds = [tuple(np.full(5, one == two) for one in numbers) for two in numbers]
    made_by = left_out.choices_by_fold(tmp_path, chosen, data, folds)
    assert {made_by(number).name for number in numbers} == {"bare"}
    assert out == [2, 2, *[1] * (left_out.MOST_SEARCHES - 2)]
