"""`simulate`: the committed recordings regenerate, files are whole, bad specs are refused."""

import subprocess
import sys
from typing import get_args, get_type_hints

import numpy as np
import pytest
from common import rows_of
from rig_cases import DATASETS, spec

from datasets.rig.simulate import (
    COLUMNS,
    SENSED,
    SET_STEPS,
    Experiment,
    causes_of,
    csv_text,
    decimals,
    label,
    recording,
)
from mapmore_cli.domain.errors import SpecError

PROJECT = DATASETS.parent
PEANO = "peano/load_cycles"


SHIPPED = [  # and which of its recordings
    *(
        (f"{kind}/{name}", slice(None))
        for kind in ("mckibben", "peano")
        for name in ("load_cycles", "inner_loops_training")
    ),
    *((f"{kind}/inner_loops_validation", slice(None)) for kind in ("mckibben", "peano")),
    ("mckibben/step_responses", slice(1, 2)),
    ("peano/perturbations", slice(0, 1)),
    ("waveforms/training", slice(3, 4)),
    ("waveforms/loads", slice(3, 4)),
    ("wrist/contraction_table", slice(None)),
]


@pytest.mark.parametrize(("path", "some"), SHIPPED, ids=[path for path, _ in SHIPPED])
def test_committed_recordings_regenerate(path, some):
    """Another machine's libm may round a value to the neighbouring step: a few may differ, each by
    one step.
    """
    study = spec(path)
    resolutions = {name: sensor.resolution for name, sensor in study.sensors.items()}
    steps = {
        "time": getattr(study.experiment, "sample_time", None),
        **SET_STEPS.get(study.experiment.type, {}),
        **resolutions,
    }
    for cause in causes_of(study)[some]:
        made = csv_text(recording(study, cause), decimals(study))
        committed = (DATASETS / path).with_name(f"{study.output}_{label(cause)}.csv").read_text()
        if made != committed:
            header, *_ = made.splitlines()
            titles = header.split(",")
            assert header == committed.splitlines()[0]
            ours, theirs = (
                np.loadtxt(text.splitlines()[1:], delimiter=",") for text in (made, committed)
            )
            flips = np.abs(
                np.round(
                    (ours - theirs)
                    / [steps[key] for key, (title, _) in COLUMNS.items() if title in titles]
                )
            )
            assert flips.max() <= 1
            assert flips.sum() <= 1 + 1e-3 * flips.size


def test_every_shipped_recording_has_its_spec():
    for path, some in SHIPPED:
        if some == slice(None):
            study = spec(path)
            shipped = {file.name for file in (DATASETS / path).parent.glob(f"{study.output}_*.csv")}
            assert shipped == {f"{study.output}_{label(cause)}.csv" for cause in causes_of(study)}


def test_every_experiment_says_what_it_measures():
    types = {get_args(get_type_hints(kind)["type"])[0] for kind in get_args(Experiment)}
    assert types == SENSED.keys()
    assert set().union(*SENSED.values()) <= COLUMNS.keys()


def test_the_steps_are_those_of_the_paper():
    """M2 table 3."""
    weights = [42, 66, 115, 213]
    for kind, pressures in (("mckibben", [80, 150, 250, 350]), ("peano", [80, 200, 350, 500])):
        steps = spec(f"{kind}/step_responses").experiment.steps
        assert [(step.pressure / 1e3, step.weight) for step in steps] == list(
            zip(pressures, weights, strict=True)
        )


def test_a_simulation_that_cannot_be_made_ends_with_the_code_of_its_error(tmp_path):
    """A spec of a study is not one of a simulation (3), and recordings that exist stay (7)."""
    for spec_, output, code in (
        ("mapmore_cli/pipeline/shipped/study.yaml", tmp_path, 3),
        ("datasets/peano/load_cycles.yaml", "datasets/peano", 7),
    ):
        line = [sys.executable, "-m", "datasets.rig", spec_, "-o", output]
        refused = subprocess.run(line, cwd=PROJECT, capture_output=True, text=True)
        assert (refused.returncode, refused.stdout) == (code, "")
        assert refused.stderr.startswith("error: ")


BAD = """
peano/load_cycles                 experiment.pressures=[80, 80]             name it once
peano/load_cycles                 experiment.pressures=[]                   at least 1
peano/load_cycles                 experiment.pressures=[-5]                 at least 0
peano/load_cycles                 experiment.pressures=[80 kPa]             should be a number
peano/load_cycles                 experiment.dwell=20                       no time to move
peano/load_cycles                 experiment.turns=[1, 0.5, 0.5]  \
    must move from each of `turns`
peano/load_cycles                 experiment.turns=[1, 0]  \
    must move from each of `turns`
peano/load_cycles                 experiment.turns=[1.1]                    at most 1
peano/load_cycles                 experiment.turns=[]                       at least 1
peano/load_cycles                 experiment.sample_time=5  \
    fewer than 100 samples
peano/load_cycles                 experiment.colour=red                     unknown key `colour`
peano/load_cycles                 hysteresis.stops=[{yield_strain: 0.01, share: 0.9}]  \
    add up to 1
peano/load_cycles                 sensors.force.resolution=0                greater than 0
peano/load_cycles                 sensors.flow={noise: 0.02, resolution: 0.01}  no others
peano/load_cycles                 muscle.kind=bellows                       kind
peano/load_cycles                 output=../elsewhere                       cannot be
peano/load_cycles                 seed=1.5                                  whole number
peano/step_responses              experiment.steps.1.pressure=80            name it once
peano/step_responses              experiment.steps.1.pressure=0             greater than 0
peano/step_responses              experiment.steps.1.weight=0.5  \
    exceed the `pretension`
peano/step_responses              experiment.rest=0.005                     ten samples
peano/step_responses              experiment.rig.tube.diameter=-1           greater than 0
peano/step_responses              experiment.reservoir.critical_ratio=1.0   less than 0.99
peano/step_responses              sensors.flow=null                         of these
peano/perturbations               experiment.between=[0.8, 0.2]             stretched end first
peano/perturbations               experiment.between=[0.8]                  too few values
peano/perturbations               experiment.moves=[]                       at least 1
peano/perturbations               experiment.moves=[0.5, 0.001]             ten samples
peano/perturbations               experiment.pressures=[80, 80.0]           name it once
peano/perturbations               experiment.type=vibration                 type
waveforms/validation              experiment.waveforms.1.name=full_stroke   a name of its own
waveforms/validation              experiment.waveforms.0.low=5              must lie below
waveforms/validation              experiment.waveforms.0.shape=saw          sine
waveforms/validation              experiment.waveforms.0.frequency=20       ten samples
waveforms/validation              experiment.waveforms.0.load=-1            at least 0
waveforms/validation              experiment.waveforms=[]                   at least 1
waveforms/validation              experiment.regulator.lag=0                greater than 0
waveforms/validation              sensors.displacement=null                 of these
waveforms/validation              sensors.strain={noise: 0, resolution: 1}  no others
waveforms/validation              muscle={kind: peano}                      kind: mckibben
wrist/contraction_table           experiment.repeats=0                      at least 1
wrist/contraction_table           sensors.force={noise: 1, resolution: 1}   no others
muscle-like/random_velocity_16cm  experiment.speeds=[0.2, 0.1]              slower one first
muscle-like/random_velocity_16cm  experiment.every=40000  \
    fewer than 100 samples
muscle-like/random_velocity_16cm  muscle={kind: peano}                      kind: mckibben
muscle-like/joint                 experiment.recordings=[swung]             closed
muscle-like/joint                 experiment.recordings=[random]            needs a `course`
muscle-like/joint                 experiment.extensor.c10=-1                at least 0
muscle-like/tendon                experiment.tendon.stiffness=0             greater than 0
"""


@pytest.mark.parametrize(
    ("path", "change", "message"),
    [
        *rows_of(BAD),
        (PEANO, "experiment.pressures=80", r"should be a list.*\n.*write `\[80\]`"),
    ],
)
def test_a_bad_spec_is_refused(path, change, message):
    with pytest.raises(SpecError, match=message):
        spec(path, change)
