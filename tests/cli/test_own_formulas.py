"""Formulas of the user's own: as good as the built-in ones wherever these may stand."""

import json
from dataclasses import replace

import numpy as np
import pytest
from cli_samples import BAR, EPS, edit

import mapmore_cli as mm
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.modelling.literature.own import formula_of
from mapmore_cli.storage.artefacts import read_model, write_model

SAROSI = {
    "name": "our_sarosi",
    "source": "M1 eq 1",
    "expression": "(a1*pressure + a2)*exp(a3*strain) + a4*strain*pressure + a5*pressure + a6",
    "parameters": {
        "a3": {"bounds": [-250, 250]},
        **{name: {"unit": "N"} for name in ("a1", "a2", "a4", "a5", "a6")},
    },
}
RNG = np.random.default_rng(5)
FRAME = {
    "pressure": 100 * BAR,
    "strain": EPS,
    "force": (240 * BAR + 50) * np.exp(-8 * EPS)
    - 500 * EPS * BAR
    + 60 * BAR
    - 40
    + RNG.normal(size=len(BAR)),
}
STUDY = {
    "levels": {"of": "pressure", "at": "auto"},
    "split": {"validate": {"pressure": [200]}},
    "dictionary": [{"polynomial": {"of": ["strain"], "order": 3}}],
}


BACKBONE = {"backbone": "our_sarosi"}


def fitted(*formulas, **more):
    """The study with formulas of its own."""
    return mm.fit(FRAME, formulas=[*formulas], **STUDY, **more)


def rows(fitted, model):
    return [row["rmse"] for row in fitted.scores if row["model"] == model]


def test_it_is_fitted_as_the_built_in_one():
    found = fitted(SAROSI, validate={"against": ["sarosi", "our_sarosi"]})
    assert rows(found, "our_sarosi") == pytest.approx(rows(found, "sarosi"), rel=1e-6)


def test_it_is_a_backbone_and_a_model_that_stands_alone(tmp_path, mapmore):
    """The file needs no spec: prediction, derivatives and exports agree with those of the built-in
    formula.
    """
    own = fitted(SAROSI, name="muscle", model=BACKBONE)
    built_in = mm.fit(FRAME, model={"backbone": "sarosi"}, **STUDY)
    points = {"pressure": 170.0, "strain": np.linspace(0.01, 0.19, 7)}
    np.testing.assert_allclose(own(**points), built_in(**points), rtol=1e-5)
    loaded = mm.load_model(own.save(tmp_path / "model.h5"))
    np.testing.assert_array_equal(loaded(**points), own(**points))
    for name, slope in built_in.derivatives(**points).items():
        np.testing.assert_allclose(loaded.derivatives(**points)[name], slope, rtol=1e-4)
    mapmore("export", tmp_path / "model.h5", "--to", "numpy", "-o", tmp_path, "-q", code=0)
    code = {}
    exec((tmp_path / "muscle.py").read_text(), code)
    np.testing.assert_allclose(code["evaluate"](**points), own(**points), rtol=1e-12)


def test_a_changed_file_makes_the_fits_stale(tmp_path):
    own = tmp_path / "own.json"
    own.write_text(json.dumps(SAROSI))
    spec = mm.fit(FRAME, model={"backbone": "sarosi"}, **STUDY).to_yaml(tmp_path / "study.yaml")
    edit(spec, "sarosi", "our_sarosi")
    spec.write_text(f"{spec.read_text()}formulas: own.json\n")
    for status in ("done", "up-to-date"):
        assert set(mm.run(spec, tmp_path / "runs").stages.values()) == {status}
    edit(own, "+ a6", "+ a6 + 0.001*a6*strain")
    assert mm.run(spec, tmp_path / "runs").stages["fit"] == "done"
    resolved = (tmp_path / "runs" / "model" / "experiment.yaml").read_text()
    assert "formulas:\n- name: our_sarosi" in resolved


def test_a_file_that_is_not_there():
    with pytest.raises(SpecError, match="there is no file"):
        fitted("nowhere.yaml")


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "{}",
        '{"bounds": 3}',
        '{"name": "a", "reference": "", "text": "((", "bounds": {}, "units": {}, "starts": null}',
    ],
)
def test_a_damaged_definition_is_refused(text):
    with pytest.raises(ValueError):  # noqa: PT011 - the reader tells it
        formula_of(text)


def test_a_model_file_with_another_definition_is_refused(tmp_path):
    path = fitted(SAROSI, model=BACKBONE).save(tmp_path / "model.h5")
    model = read_model(path)
    backbone = replace(model.backbone, definition="{}")
    write_model(path, replace(model, body=replace(model.body, backbone=backbone)))
    with pytest.raises(DataError, match="no valid definition of a formula"):
        mm.load_model(path)
