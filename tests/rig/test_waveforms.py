"""A muscle behind a regulator: the commanded waveforms, the laws that the rig must obey, and what P says of its data."""

from __future__ import annotations

import copy
import csv
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.integrate import trapezoid

from mapmore_cli.rig.waveform import Waveform, waveform_response
from mapmore_cli.spec.loader import load_as
from mapmore_cli.spec.simulation import SimulationSpec
from mapmore_cli.study.simulate import csv_text, decimals, label, recording, waveform_rig_of

DATASETS = Path(__file__).parents[2] / "datasets"
WAVEFORMS = DATASETS / "waveforms"
SPECS = {use: load_as(WAVEFORMS / f"{use}.yaml", SimulationSpec).spec for use in ("training", "validation", "loads")}
ALL = [(use, waveform) for use, spec in SPECS.items() for waveform in spec.experiment.waveforms]
FREE = {1.4: 1.7, 3.0: 6.4, 4.0: 8.8, 5.0: 9.9, 6.0: 10.3}
"""Free contraction (cm) of the muscle at pressures in bar, as P's data suggest it."""


@cache
def rig():
    spec = SPECS["validation"]
    return waveform_rig_of(spec.muscle, spec.hysteresis, spec.experiment)


@cache
def response(shape="sine", high=5.0, frequency=0.5, load=0.0):
    return waveform_response(rig(), Waveform(shape, 0.0, high, frequency, 1, 0.1, 0.0, 0.01), load)


def committed(name):
    table = np.loadtxt(WAVEFORMS / name, delimiter=",", skiprows=1)
    return dict(zip("tUPxW", table.T, strict=True))


@given(
    st.sampled_from(["sine", "triangle", "square"]),
    st.floats(0, 4),
    st.floats(0.1, 5),
    st.sampled_from([0.25, 0.5, 1.0]),
    st.integers(1, 4),
)
def test_a_command_repeats_within_its_bounds(shape, low, swing, frequency, wavelengths):
    waveform = Waveform(shape, low, low + swing, frequency, wavelengths, 0.5, low, 0.01)
    u = waveform.command(waveform.clock)
    assert u.min() == pytest.approx(low)
    assert u.max() == pytest.approx(low + swing)
    period = round(1 / frequency / 0.01)
    np.testing.assert_allclose(u[50 : 50 + (wavelengths - 1) * period], u[50 + period : 50 + wavelengths * period], atol=1e-9)
    assert np.all(u[:50] == low)


def test_shapes_begin_at_the_low_end_and_a_square_wave_at_the_high_one():
    quarter = np.array([0.0, 0.25, 0.5, 0.75])
    shares = {
        shape: Waveform(shape, 0, 1, 1.0, 1, 0.0, 0.0, 0.01).command(quarter).round(6).tolist() for shape in ("sine", "triangle", "square")
    }
    assert shares == {"sine": [0, 0.5, 1, 0.5], "triangle": [0, 0.5, 1, 0.5], "square": [1, 1, 0, 0]}


@pytest.mark.parametrize(("bar", "centimetres"), FREE.items())
def test_free_contraction_is_what_the_published_data_suggest(bar, centimetres):
    model = rig()
    travel = model.muscle.length * (model.resting_strain(bar * 1e5, 0.0) - model.resting_strain(float(model.regulator.wanted(0.0)), 0.0))
    assert 100 * travel == pytest.approx(centimetres, abs=0.3)


def test_a_load_stretches_the_muscle_at_rest_and_hardly_shortens_the_stroke():
    """P section 4: "the weight to have little effect on the motion"."""
    free, loaded = response(), response(load=5.0)
    assert loaded["displacement"][0] < free["displacement"][0] == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(loaded["displacement"]) == pytest.approx(np.ptp(free["displacement"]), rel=0.06)


def test_the_load_cell_feels_weight_and_inertia():
    truth = response(load=5.0)
    assert truth["load"][0] == pytest.approx(5 * 9.81, rel=1e-6)
    # Over the whole motion the inertia's impulse is the change of momentum.
    step = truth["time"][1]
    speed = np.gradient(truth["displacement"], step)
    impulse = trapezoid(truth["load"] - 5 * 9.81, dx=step)
    assert impulse == pytest.approx(5 * (speed[-1] - speed[0]), abs=0.05)
    assert np.all(response()["load"] == 0.0)


@pytest.mark.parametrize("use", ["training", "loads"])
def test_a_committed_recording_regenerates(use):
    """Another machine's libm may round a value to the neighbouring step."""
    spec = SPECS[use]
    steps = [0.01, 0.001, 0.1, 0.01, 0.1]
    third = spec.experiment.waveforms[3]
    made = csv_text(recording(spec, third), decimals(spec)).splitlines()
    table = (WAVEFORMS / f"{spec.output}_{label(third)}.csv").read_text().splitlines()
    assert made[0] == table[0] == "t,U,P,x,W"
    ours, theirs = (np.loadtxt(lines[1:], delimiter=",") for lines in (made, table))
    flips = np.abs(np.round((ours - theirs) / steps))
    assert flips.max() <= 1
    assert flips.mean() < 1e-2


def test_the_waveforms_are_those_of_the_published_table():
    """P table 2, its column of types read with the names."""
    with (DATASETS / "published" / "p_table_2.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    lows, swings = ([float(row[key]) for row in rows] for key in ("offset_V", "amplitude_V"))
    told = [
        (row["experiment"], low, low + swing, float(row["frequency_Hz"]), int(row["wavelengths"]), float(row["load_kg"]))
        for row, low, swing in zip(rows, lows, swings, strict=True)
    ]
    ours = [
        (each.name, each.low, each.high, each.frequency, each.wavelengths, each.load) for each in SPECS["validation"].experiment.waveforms
    ]
    assert ours == told
    shapes = {each.name: each.shape for each in SPECS["validation"].experiment.waveforms}
    assert shapes == dict.fromkeys(shapes, "sine") | {"triangle": "triangle", "square": "square"}


@pytest.mark.parametrize(
    ("where", "value", "message"),
    [
        (("experiment", "waveforms", 1, "name"), "full_stroke", "a name of its own"),
        (("experiment", "waveforms", 0, "low"), 5, "must lie below"),
        (("experiment", "waveforms", 0, "shape"), "saw", "sine"),
        (("experiment", "waveforms", 0, "frequency"), 20, "ten samples"),
        (("experiment", "waveforms", 0, "load"), -1, "greater than or equal to 0"),
        (("experiment", "waveforms"), [], "at least 1"),
        (("experiment", "regulator", "lag"), 0, "greater than 0"),
        (("sensors", "displacement"), None, r"sensors\.displacement` is missing"),
        (("sensors", "strain"), {"noise": 0, "resolution": 1}, r"sensors\.strain` goes with load_cycles"),
        (("muscle",), {"kind": "peano"}, "kind: mckibben"),
    ],
)
def test_a_bad_spec_is_refused(where, value, message):
    document = copy.deepcopy(yaml.safe_load((WAVEFORMS / "validation.yaml").read_text("utf-8")))
    part = document
    for key in where[:-1]:
        part = part[key]
    part[where[-1]] = value
    with pytest.raises(ValidationError, match=message):
        SimulationSpec.model_validate(document)
