"""Step responses at ingest: the plateau, the pressure on it, and the damping force that a static
model leaves.
"""

from dataclasses import replace

import numpy as np
import pytest
from ingest_samples import COLUMNS, csv_text, spec_of
from reading import refused

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.domain.recording import CurveRange, Quantity
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.modelling import literature
from mapmore_cli.storage.artefacts import write_model

TIME = np.arange(0.0, 3.0, 0.005)
GRID = {
    name: x.ravel()
    for name, x in zip(
        ("pressure", "strain"),
        np.meshgrid(np.linspace(0, 400, 9), np.linspace(0, 0.2, 9)),
        strict=True,
    )
}
FORCE = (
    2.0 * GRID["pressure"] * np.exp(-5 * GRID["strain"]) - GRID["strain"] * GRID["pressure"] + 3.0
)


def step(height, extra=0.0):
    """A step to `height` between 0.2 s and 2 s; the force is that of `sarosi_model`, plus `extra`,
    plus 40 N while it moves.
    """
    ramp = np.clip((TIME - 0.2) / 0.3, 0, 1) - np.clip((TIME - 2.0) / 0.3, 0, 1)
    pressure, strain = height * ramp, 0.1 * ramp
    moving = (np.abs(np.gradient(ramp)) > 0) * 40.0
    static = 2.0 * pressure * np.exp(-5 * strain) - strain * pressure + 3.0
    return csv_text(t=TIME, P=pressure, eps=strain, F=static + extra + moving)


def sarosi_model(**changes):
    fit = literature.get("sarosi").fit(GRID, FORCE)
    inputs = (Quantity("pressure", "kPa"), Quantity("strain", "1"))
    limits = {quantity.name: (0.0, 1000.0) for quantity in changes.get("inputs", inputs)}
    body = Formula(fit, None, (CurveRange("all", None, limits),))
    return replace(Model("s", Quantity("force", "N"), inputs, body), **changes)


def ingest(folder, recordings, model=None, **data):
    for name, text in recordings.items():
        (folder / name).write_text(text)
    (folder / "run").mkdir(exist_ok=True)
    write_model(folder / "run" / "model.h5", model or sarosi_model())
    section = {"files": ["*.csv"], "plateau": "auto", **data}
    spec = spec_of(section, target="damping", needs={"static": "static.yaml"})
    return build_dataset(slice_of(spec), folder, static_run=folder / "run")


def test_damping_is_what_the_static_model_leaves_less_its_mean_on_the_plateau(
    tmp_path,
):
    """A constant error of the static model is taken away, in each recording its own."""
    levels = {"of": "step_pressure", "at": [100, 200]}
    dataset = ingest(
        tmp_path, {"a.csv": step(199.0, extra=7.0), "b.csv": step(101.0, extra=-3.0)}, levels=levels
    )
    assert dataset.target == "damping"
    assert [curve.id for curve in dataset.curves] == ["step_pressure=100", "step_pressure=200"]
    for curve, height in zip(dataset.curves, (101.0, 199.0), strict=True):
        time, damping = curve.columns["time"], curve.columns["damping"]
        # the band takes in the ends of both ramps
        assert curve.columns["step_pressure"] == pytest.approx(height, rel=1e-3)
        assert (time[curve.at_rest].min(), time[curve.at_rest].max()) == (
            pytest.approx(0.5, abs=0.03),
            pytest.approx(2.0, abs=0.03),
        )
        assert damping[curve.at_rest].mean() == pytest.approx(0.0, abs=1e-9)
        assert curve.columns["force"] - curve.columns["static_force"] - damping == pytest.approx(
            np.mean((curve.columns["force"] - curve.columns["static_force"])[curve.at_rest])
        )
        assert "plateau" not in curve.columns
        assert np.array_equal(curve.training, ~curve.at_rest)


def test_a_given_plateau_takes_the_place_of_the_found_one(tmp_path):
    dataset = ingest(tmp_path, {"a.csv": step(200.0)}, plateau=[1.0, 1.5])
    (curve,) = dataset.curves
    assert curve.columns["time"][curve.at_rest][[0, -1]] == pytest.approx([1.0, 1.5])


@pytest.mark.parametrize(
    ("recording", "words"),
    [
        (
            csv_text(t=TIME, P=200 - 100 * np.abs(TIME - 1.5), eps=0 * TIME, F=TIME),
            ["a.csv", "no plateau", "plateau: [2 s, 3 s]"],
        ),
        (
            csv_text(t=TIME, P=0 * TIME + 5, eps=0 * TIME, F=TIME),
            ["a.csv", "never rises", "stays between 5 and 5"],
        ),
    ],
    ids=["triangle", "constant"],
)
def test_a_recording_without_a_plateau_is_refused(recording, words, tmp_path):
    with refused(*words):
        ingest(tmp_path, {"a.csv": recording})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"output": Quantity("force", "kN")}, "force in kN, not force in N"),
        ({"output": Quantity("displacement", "m")}, "displacement in m, not force in N"),
        (
            {"inputs": (Quantity("pressure", "bar"), Quantity("strain", "1"))},
            "pressure in bar; this study has it in kPa",
        ),
        (
            {
                "inputs": (
                    Quantity("length", "m"),
                    Quantity("pressure", "kPa"),
                    Quantity("strain", "1"),
                )
            },
            "length in m; this study lacks it",
        ),
    ],
    ids=["unit", "quantity", "unit of an input", "absent input"],
)
def test_a_static_model_of_another_unit_or_quantity_is_refused(changes, words, tmp_path):
    with refused("needs.static: the model of s ", words, error=SpecError):
        ingest(tmp_path, {"a.csv": step(200.0)}, sarosi_model(**changes))


def test_the_direction_follows_from_a_rate_in_the_units_of_the_model(tmp_path):
    """The record's time is in ms and its pressure in bar; rates are per second and in kPa."""
    ms = step(2.0).replace("t,", "t,", 1).splitlines()
    rows = [
        ms[0],
        *(",".join([repr(float(r.split(",")[0]) * 1000), *r.split(",")[1:]]) for r in ms[1:]),
    ]
    columns = {
        **COLUMNS,
        "time": {"column": "t", "unit": "ms"},
        "pressure": {"column": "P", "unit": "bar"},
    }
    derive = {
        "pressure_rate": {"rate_of": "pressure", "window": 0.04, "order": 3},
        "direction": {"direction_of": "pressure_rate", "dead_band": 50.0},
    }
    (curve,) = ingest(
        tmp_path, {"a.csv": "\n".join(rows) + "\n"}, columns=columns, derive=derive
    ).curves
    time, rate = curve.columns["time"], curve.columns["pressure_rate"]
    assert rate[np.abs(time - 0.35) < 0.05] == pytest.approx(200 / 0.3, rel=1e-6)
    assert set(curve.columns["direction"][time < 1.9]) == {1.0}
    assert set(curve.columns["direction"][time > 2.1]) == {-1.0}
