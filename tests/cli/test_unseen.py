"""What is held out has no say: turned round, it changes no byte of what is fitted or chosen."""

from pathlib import Path

import numpy as np
import pytest
import unseen_tables
from page_tables import DOCS, rows_of
from unseen_tables import COLUMNS, KINDS, PRESSURES, SAME, cell, force_map, splits_of

from mapmore_cli.fitting.left_out import left_out
from mapmore_cli.pipeline import scoring
from mapmore_cli.storage.run_folder import MODEL, RunFiles

SLOW = ("search", "optimal", "auto", "hinged")
QUICK = [kind for kind in KINDS if not any(word in kind for word in SLOW)]


@pytest.mark.parametrize("kind", QUICK)
def test_one_split_of_every_kind(kind):
    """Kinds in turn have splits in turn."""
    splits = splits_of(kind)
    assert cell(kind, splits[QUICK.index(kind) % len(splits)]) == SAME


@pytest.mark.parametrize("split", ["fraction", "between"])
@pytest.mark.parametrize("kind", ["memory", "memory, stop: free_run"])
def test_a_held_out_output_is_not_the_past_of_a_training_sample(kind, split):
    assert cell(kind, split) == SAME


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_every_split(kind):
    assert {cell(kind, split) for split in splits_of(kind)} == {SAME}


def test_the_page_has_every_kind_and_every_cell_is_the_same():
    rows = {row[0]: row[1:] for row in rows_of("unseen", DOCS / "search.md")}
    assert set(rows) == set(KINDS)
    for kind, cells in rows.items():
        known = [name in splits_of(kind) for name in COLUMNS]
        assert [text.strip() == SAME for text in cells] == known


def test_what_has_seen_held_out_data_is_noticed(monkeypatch):
    def everything(_kind, dataset):
        return np.concatenate([c.columns[dataset.target] for c in dataset.curves]).tobytes()

    monkeypatch.setattr(unseen_tables, "made", everything)
    assert cell("pieces", "last") == unseen_tables.SEEN


STUDY = """
schema_version: 1
name: map
data:
  files: ["*.csv"]
  columns:
    pressure: {{column: P, unit: kPa}}
    strain: {{column: eps}}
    diameter: {{column: d, unit: mm}}
    force: {{column: F, unit: N}}
  levels: {{of: pressure, at: auto}}
  groups: {groups}
  split: {split}
target: force
segment: {{strain: {{method: even, count: 2}}}}
dictionary: [{{polynomial: {{of: [strain], order: 3}}}}]
fit: {{max_terms: 2}}
model: {{backbone: {backbone}}}
validate: {{intervals: {intervals}, against: {against}}}
"""


def measured(folder, turned, **words):
    """A study of two specimens; the forces at one pressure may be turned round."""
    folder.mkdir()
    for specimen in (0, 1):
        for pressure, curve in zip(PRESSURES, force_map().curves, strict=True):
            force = (1 + 0.1 * specimen) * curve.columns["force"] + 5 * specimen
            if turned and pressure == 300:
                force = 2 * force[::-1] + 1
            columns = {name: curve.columns[name] for name in ("pressure", "strain")}
            rows = zip(*columns.values(), force, strict=True)
            text = "".join(f"{p:.4f},{s:.5f},{10 + specimen},{f:.5f}\n" for p, s, f in rows)
            (folder / f"{specimen}_{pressure:g}.csv").write_text(f"P,eps,d,F\n{text}")
    spec = folder / "map.yaml"
    spec.write_text(STUDY.format(**words))
    return spec


@pytest.fixture
def both(tmp_path, mapmore, monkeypatch):
    """Two validated runs of which one has other forces at 300 kPa, and what commands print."""

    def make(*lines, **words):
        found = []
        for turned in (False, True):
            spec = measured(tmp_path / str(turned), turned, **words)
            monkeypatch.chdir(spec.parent)
            mapmore("validate", spec.name, "--no-check", code=0)
            printed = [mapmore(*line, code=0).stdout for line in lines]
            found.append((RunFiles(Path("runs/map").resolve()), printed))
        return found

    return make


PAIR = (
    "{as: pair, sum: [{formula: sarosi, inputs: {pressure: pressure, strain: strain}}, "
    "{formula: chou_hannaford, inputs: {pressure: pressure, strain: strain}}]}"
)
EFFECTS = "{of: diameter, offset: true, gain: true}"
GRID = "pressure=100:500:100,strain=0:0.1:0.02"
LINES = [
    ("predict", "runs/map/model.h5", "--grid", GRID, "--interval", "0.95"),
    ("tune", "map.yaml", "--over", "fit.max_terms=1,2", "--json"),
    ("plan", "map.yaml", "--json"),
]


def test_held_out_data_have_no_say_in_competitors_intervals_groups_tune_and_plan(both):
    """Beside the model: offsets of groups, competitors, intervals, `tune` and `plan`."""
    (one, printed), (other, turned) = both(
        *LINES,
        split="{validate: {pressure: [300]}}",
        groups=EFFECTS,
        intervals="true",
        backbone="sarosi",
        against=f"[polynomial_2, gradient_boosting, {PAIR}]",
    )
    assert (one.folder / MODEL).read_bytes() == (other.folder / MODEL).read_bytes()
    assert printed == turned
    said, again = one.validation(), other.validation()
    assert "gradient_boosting" in said.predictions
    np.testing.assert_equal(said.predictions, again.predictions)


FOLDS = {"split": "{leave_one_level_out: true}", "intervals": "false"}


@pytest.mark.parametrize(
    ("backbone", "against", "groups"),
    [
        ("null", "[polynomial_2]", EFFECTS),
        pytest.param("auto", f"[gradient_boosting, {PAIR}]", EFFECTS, marks=pytest.mark.long),
        pytest.param("null", "[polynomial_2]", "{of: diameter}", marks=pytest.mark.long),
    ],
)
def test_a_fold_has_not_seen_what_it_is_scored_on(both, monkeypatch, backbone, against, groups):
    """Every level is left out once: its own forces change nothing of what is said of it."""
    said = []

    def kept(*args):
        found = left_out(*args)
        said.append(found[1])
        return found

    monkeypatch.setattr(scoring, "left_out", kept)
    (one, _), _ = both(**FOLDS, groups=groups, backbone=backbone, against=against)
    curves = one.dataset().curves
    for name, forecasts in said[0].items():
        changed = [
            round(curve.level, -1)
            for before, after, curve in zip(forecasts, said[1][name], curves, strict=True)
            if not np.array_equal(before.values, after.values)
        ]
        assert changed, name
        assert 300 not in changed, name
