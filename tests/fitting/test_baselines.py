"""Black boxes among the competitors and beside a search: the same samples, the same inputs,
explicit seeds.
"""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from common import curve_of, dataset_of
from surfaces import QUANTITIES

from mapmore_cli.annexes.search.black_boxes import black_boxes
from mapmore_cli.annexes.search.samples import MOST_SAMPLES
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.scores import OWN, REPEATABILITY
from mapmore_cli.fitting import baselines
from mapmore_cli.modelling import learners
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.literature import names
from mapmore_cli.modelling.signals.sampling import even_share
from mapmore_cli.modelling.simple import SIMPLE
from mapmore_cli.study.loader import load

SPEC = """\
schema_version: 1
name: bench
data:
  files: ["bench.csv"]
  columns: {{pressure: {{column: P, unit: kPa}}, strain: {{column: eps}}, force: {{column: F}}}}
target: {{column: force}}
dictionary: [{{polynomial: {{of: [strain, pressure], order: 1}}}}]
validate: {{against: [{against}]}}
"""


def dataset(held_out_scale=1.0):
    """A smooth surface in plain noise, every fourth sample held out."""
    random = np.random.default_rng(3)
    pressure, strain = random.uniform(0, 400, 160), random.uniform(0, 0.2, 160)
    force = pressure * (2 - 8 * strain) + 30 * np.sin(20 * strain) + random.normal(0, 2, 160)
    held_out = np.arange(160) % 4 == 0
    columns = {
        "pressure": pressure,
        "strain": strain,
        "force": np.where(held_out, held_out_scale * force, force),
    }
    return Dataset("force", None, QUANTITIES, (), (curve_of(columns, held_out),))


MODEL = Model("own", QUANTITIES["force"], (QUANTITIES["pressure"], QUANTITIES["strain"]), None)


@pytest.fixture(autouse=True)
def plain_kind(monkeypatch):
    monkeypatch.setattr(baselines, "runs_over_time", lambda _own: False)


@pytest.mark.parametrize("name", LEARNERS)
def test_a_smooth_surface_is_learnt_from_training_samples_alone(name):
    (curve,) = dataset().curves
    (first,) = baselines.predictions(name, dataset(), MODEL)
    (again,) = baselines.predictions(name, dataset(held_out_scale=-5.0), MODEL)
    np.testing.assert_array_equal(first, again)
    force = curve.columns["force"][curve.held_out]
    assert np.sqrt(np.mean((first[curve.held_out] - force) ** 2)) < 0.2 * np.std(force)


def test_learners_have_a_title_a_name_of_their_own_and_a_seed():
    """Competitors are named alike whatever they are: formulas, simple models and black boxes."""
    assert all(learner.title for learner in LEARNERS.values())
    assert not {*LEARNERS} & {OWN, REPEATABILITY, *SIMPLE, *names()}
    made = (learner.make(1) for learner in LEARNERS.values())
    assert {one.get_params().get("random_state", 0) for one in made} == {0}


def test_no_learner_stops_early():
    x = np.linspace(-2, 2, 40)[:, None]
    y = np.sin(2 * x[:, 0]) + np.random.default_rng(0).normal(0, 0.1, 40)
    made = [LEARNERS[name].make(1) for name in ("gaussian_process", "gradient_boosting", "mlp")]
    process, boosting, network = made
    boosting.fit(x, y)
    assert boosting.n_iter_ == 300
    assert process.fit(x, y).predict(x) == pytest.approx(np.sin(2 * x[:, 0]), abs=0.15)
    assert network.hidden_layer_sizes == (32, 32)


def test_every_learner_of_the_module_is_declared():
    made = {one.make.__name__ for one in LEARNERS.values()}
    assert made == {name for name in vars(learners) if name.startswith("_") and name[1] != "_"}


def test_more_samples_than_a_baseline_can_bear_are_thinned_evenly():
    values = np.arange(1000.0)
    kept = even_share(values, 11)
    assert kept.tolist() == [round(k * 99.9) for k in range(11)]
    assert even_share(values, 1000) is values


def test_beside_a_model_with_a_past_inputs_come_with_theirs():
    columns = {"pressure": np.arange(6.0), "strain": np.zeros(6), "force": np.zeros(6)}
    curve = Curve(
        "r", None, columns, np.zeros(6, dtype=bool), ("a", "b"), origin=np.array([0, 0, 0, 1, 1, 1])
    )
    found = baselines.features(curve, ["pressure"], (0, 2))
    assert found.tolist() == [[0, 0], [1, 0], [2, 0], [3, 3], [4, 3], [5, 3]]


def test_missing_inputs_give_no_prediction():
    data = dataset()
    data.curves[0].columns["strain"][5] = np.nan
    (found,) = baselines.predictions("gradient_boosting", data, MODEL)
    assert np.flatnonzero(np.isnan(found)).tolist() == [5]


def test_without_scikit_learn_a_spec_says_what_to_install(tmp_path, monkeypatch):
    spec = tmp_path / "bench.yaml"
    spec.write_text(SPEC.format(against="mlp"))
    monkeypatch.setattr("mapmore_cli.study.checks.competitors.find_spec", lambda _name: None)
    with pytest.raises(SpecError, match=r"bench\.yaml:\d+:\d+: `mlp` needs scikit-learn") as told:
        load(spec)
    assert "pip install 'mapmore[baselines]'`, or leave `mlp` out" in str(told.value)


@pytest.mark.parametrize(
    ("against", "told"),
    [
        ("{model: mlp, method: simplex}", "`mlp` has no `method`"),
        ("gaussian_proces", "did you mean `gaussian_process`"),
    ],
)
def test_what_a_baseline_is_not(against, told, tmp_path):
    spec = tmp_path / "bench.yaml"
    spec.write_text(SPEC.format(against=against))
    with pytest.raises(SpecError, match=told):
        load(spec)
    spec.write_text(SPEC.format(against="") + "model: {backbone: mlp}\n")
    with pytest.raises(SpecError, match="there is no literature model `mlp`"):
        load(spec)


def test_scikit_learn_is_imported_only_to_fit_one(tmp_path):
    spec = tmp_path / "bench.yaml"
    spec.write_text(SPEC.format(against="mlp"))
    script = (
        "import sys; from pathlib import Path; import mapmore_cli.fitting.baselines; from "
        "mapmore_cli.study.loader import load; "
    )
    script += f"load(Path({str(spec)!r})); assert 'sklearn' not in sys.modules"
    subprocess.run([sys.executable, "-c", script], check=True)


def test_a_run_scores_them_beside_its_model(tmp_path):
    from mapmore_cli.pipeline.runner import bring_up_to_date
    from mapmore_cli.storage.run_folder import RunFiles

    columns = dataset().curves[0].columns
    lines = [
        f"{p:.5g},{e:.5g},{f:.5g}"
        for p, e, f in zip(columns["pressure"], columns["strain"], columns["force"], strict=True)
    ]
    (tmp_path / "bench.csv").write_text("\n".join(["P,eps,F", *lines]) + "\n")
    spec = tmp_path / "bench.yaml"
    spec.write_text(SPEC.format(against="{model: gradient_boosting, as: trees}"))
    outcome = bring_up_to_date(load(spec), tmp_path / "runs", "validate")
    assert {row.model for row in RunFiles(outcome.run_dir).validation().scores} == {
        "mapmore",
        "trees",
        "plane",
        "quadratic",
        "cubic",
    }


def _boosted(outcomes):
    return next(left for tried, left in outcomes if tried.words == "gradient boosting")


def test_black_boxes_learn_without_the_fold_and_get_the_past_where_there_is_one():
    """Samples in the order of time have a past at uneven steps, too: structures of such a table may
    use the direction of motion, and a yardstick that does not know it is no yardstick.
    """
    time = np.linspace(0, 1, 240)
    u = np.sin(40 * time)
    data = dataset_of({"time": time, "u": u, "y": np.concatenate([np.zeros(4), u[:-4]])})
    masks = [np.arange(240) % 3 == fold for fold in range(3)]
    table = Situation("y", ("u",), None, 240, 1)
    errors = [
        _boosted(black_boxes(data, masks, of))
        for of in (table, replace(table, ordered=True), replace(table, step=time[1]))
    ]
    static, *with_past = (np.sqrt(np.mean(np.concatenate(each) ** 2)) for each in errors)
    assert max(with_past) < 0.3 * static
    assert [len(left) for left in errors[0]] == [80] * 3


def test_boosting_learns_from_as_many_samples_as_structures_do(monkeypatch):
    """Trees that learn from an eighth of the samples err more than those that a page compares."""
    sizes = list[int]()

    def learned(_name, _x, y):
        sizes.append(len(y))
        return lambda at: np.zeros(len(at))

    monkeypatch.setattr("mapmore_cli.annexes.search.black_boxes.learned", learned)
    x = np.linspace(0, 1, MOST_SAMPLES)
    for step in (None, x[1]):
        of = Situation("y", ("u",) * 5, None, MOST_SAMPLES, 1, step)
        black_boxes(dataset_of({"u": x, "y": x}), [x < 0.2], of)
    assert min(sizes) == round(0.8 * MOST_SAMPLES)
