from itertools import combinations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ingest_samples import csv_text, spec_of, steps
from reading import refused

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.modelling.signals.cycles import last_cycles
from mapmore_cli.pipeline.differences import recorded
from mapmore_cli.pipeline.stages import INGEST

REPEATS = {
    f"{level}_{repeat}.csv": steps(level, F=100 * level + repeat)
    for level in (80, 150, 250)
    for repeat in (1, 2)
}
LEVELS = {"of": "pressure", "at": "auto"}


def validating(dataset):
    return {curve.id: int(curve.held_out.sum()) for curve in dataset.curves if curve.held_out.any()}


def test_curves_come_in_the_order_of_their_levels_and_join_recordings(ingest):
    dataset = ingest(
        {"z.csv": steps(-5), "b.csv": steps(80), "a.csv": steps(80), "c.csv": steps(0)},
        levels=LEVELS,
    )
    assert [(c.id, c.level, c.recordings) for c in dataset.curves] == [
        ("pressure=-5", -5.0, ("z",)),
        ("pressure=0", 0.0, ("c",)),
        ("pressure=80", 80.0, ("a", "b")),
    ]
    assert dataset.level == "pressure"
    assert dataset.notes == ("levels of pressure: -5, 0, 80 (within 2.5)",)


def test_levels_of_constants_set_for_files(ingest):
    strains = [0.0, 0.0412, 0.0824, 0.1236]
    files = [{"path": f"{k}_*.csv", "set": {"length": x}} for k, x in enumerate(strains)]
    dataset = ingest(
        {f"{k}_{r}.csv": steps(100 * k) for k in range(4) for r in "ab"},
        files=files,
        levels={"of": "length", "at": "auto"},
    )
    assert [curve.level for curve in dataset.curves] == strains
    assert [curve.recordings for curve in dataset.curves] == [
        (f"{k}_a", f"{k}_b") for k in range(4)
    ]


def test_the_value_of_a_level_is_what_was_measured_or_the_nominal_one(ingest):
    text = csv_text(t=np.arange(6), P=[79, 80, 82, 149, 150, 152], eps=[0.0, 0.1, 0.2] * 2, F=0)
    files, levels = {"a.csv": text}, {"of": "pressure", "at": [80.0, 150.0]}
    measured, nominal = (
        ingest(files, levels={**levels, **value}) for value in ({}, {"value": "nominal"})
    )
    assert [curve.columns["pressure"].tolist() for curve in measured.curves] == [
        [79, 80, 82],
        [149, 150, 152],
    ]
    assert [curve.columns["pressure"].tolist() for curve in nominal.curves] == [[80] * 3, [150] * 3]
    assert [curve.limits("pressure") for curve in nominal.curves] == [(80, 80), (150, 150)]
    assert [one.columns["pressure"].tolist() for one in nominal.recordings] == [
        [79, 80, 82, 149, 150, 152]
    ]
    held = {"split": {"validate": {"pressure": {"between": [(81, 83)]}}}}
    first, _ = ingest(files, levels={**levels, "value": "nominal"}, **held).curves
    assert first.held_out.tolist() == [False, False, True]


@pytest.mark.parametrize(
    ("choice", "expected"),
    [
        ({"pressure": [150.0]}, [0, 40, 0]),
        ({"pressure": [150.6, 79.4]}, [40, 40, 0]),
        ({"time": {"between": [(0.0, 0.45), (1.75, 9.0)]}}, [14, 14, 14]),
        ({"force": [8001.0]}, [20, 0, 0]),
        ({"force": {"between": [(8001.0, 8002.0)]}}, [40, 0, 0]),
        ({"files": ["*_2.csv"]}, [20, 20, 20]),
        ({"files": ["./80_1.csv"]}, [20, 0, 0]),
        ({"recordings": ["250_*", "80_1"]}, [20, 0, 40]),
        ({"last": 0.25}, [10, 10, 10]),
        ({"recordings": ["80_1"], "last": 0.5}, [10, 0, 0]),
    ],
)
def test_what_is_held_out(ingest, choice, expected):
    dataset = ingest(REPEATS, levels=LEVELS, split={"validate": choice})
    assert [int(curve.held_out.sum()) for curve in dataset.curves] == expected


def test_held_out_samples_are_marked_one_by_one(ingest):
    for choice, held_out in (
        ({"files": ["*_2.csv"]}, lambda columns: columns["force"] % 100 == 2),
        ({"last": 0.25}, lambda columns: columns["time"] >= 1.45),
    ):
        for curve in ingest(REPEATS, levels=LEVELS, **held(**choice)).curves:
            np.testing.assert_array_equal(curve.held_out, held_out(curve.columns))


def test_random_fraction_is_exact_and_hangs_on_the_seed_alone(ingest):
    def chosen(*seed):
        choice = {"fraction": 0.25, **dict(zip(["seed"], seed, strict=False))}
        dataset = ingest(REPEATS, levels=LEVELS, split={"validate": choice})
        return np.concatenate([curve.held_out for curve in dataset.curves])

    assert chosen(1).sum() == 30
    np.testing.assert_array_equal(chosen(1), chosen(1))
    assert (chosen(1) != chosen(2)).any()
    np.testing.assert_array_equal(chosen(), chosen(0))


def held(**choice):
    return {"split": {"validate": choice}}


BROKEN = {
    "no such level": (held(pressure=[300.0]), ["no level pressure=300", "levels 80, 150, 250"]),
    "no name of a level": (
        held(pressure=[171.0]),
        ["no level pressure=171"],
    ),  # though a sample of it goes to the nearest level
    "between levels": (held(pressure=[115.0]), ["no level pressure=115"]),
    "no such value": (held(force=[7.0]), ["force is never 7", "8001 to 25002", "between"]),
    "no such interval": (
        held(time={"between": [(5.0, 6.0)]}),
        ["time between 5 and 6", "0 to 1.9"],
    ),
    "no such file": (
        held(files=["*_2.csv", "*_3.csv"]),
        ["files: '*_3.csv' matches nothing", "80_1.csv"],
    ),
    "no such recording": (held(recordings=["x*"]), ["recordings: 'x*' matches nothing", "80_1"]),
    "nothing left": (held(files=["*.csv"]), ["none is left for training"]),
    "nothing in both": (held(recordings=["80_1"], pressure=[150.0]), ["no sample fulfils all"]),
    "empty level": (
        {"levels": {"of": "pressure", "at": [80.0, 500.0]}},
        ["within 210 of pressure=500", "80 to 250"],
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_choices_that_the_data_cannot_fulfil(ingest, case):
    data, parts = BROKEN[case]
    with refused(*parts):
        ingest(REPEATS, **{"levels": LEVELS, **data})


def test_sweep_has_no_levels_to_find(ingest):
    with pytest.raises(DataError, match="strain is never held constant"):
        ingest({"a.csv": steps(80, 500)}, levels={"of": "strain", "at": "auto"})


def cycle(level):
    strain = np.concatenate([np.linspace(0, 0.2, 400), np.linspace(0.2, 0, 400)])
    side = np.repeat([-1, 1], 400)
    return csv_text(
        t=np.arange(800) * 0.01,
        P=level + 0.1 * side,
        eps=strain,
        F=level * (1 - strain / 0.2) + side * (2 + 10 * strain),
    )


def test_cycles_become_static_and_hysteresis_curves(ingest):
    files = {f"{level}.csv": cycle(level) for level in (80, 150)}
    data = {
        "cycles": {"over": "strain", "samples": 50},
        "levels": {"of": "pressure", "at": [80.0, 150.0]},
    }
    static = ingest(files, **data, split={"validate": {"pressure": [150.0]}})
    assert (static.target, [curve.held_out.all() for curve in static.curves]) == (
        "force",
        [False, True],
    )
    for curve in static.curves:
        strain = curve.columns["strain"]
        assert list(curve.columns) == ["strain", "pressure", "force", "hysteresis"]
        np.testing.assert_allclose(
            curve.columns["force"], curve.level * (1 - strain / 0.2), atol=1e-9
        )
        np.testing.assert_allclose(curve.columns["pressure"], curve.level, atol=1e-9)
        np.testing.assert_allclose(curve.columns["hysteresis"], 2 + 10 * strain, atol=1e-9)
    assert static.recordings[0].rows_kept == 800
    hysteresis = ingest(files, **data, target="hysteresis")
    assert (hysteresis.target, hysteresis.unit("hysteresis")) == ("hysteresis", "N")
    named = ingest(files, **data, target={"column": "pressure"})
    assert (named.target, named.unit("hysteresis")) == ("pressure", "kPa")
    # both branches share the strain, which has no hysteresis
    inverse = ingest(files, **data, target={"column": "strain"})
    assert {*inverse.curves[0].columns} == {"pressure", "strain", "force"}


def test_recording_without_a_cycle_is_named(ingest):
    with pytest.raises(
        DataError, match=r"b\.csv, level 150 \(20 samples\): there is no full load cycle"
    ):
        ingest({"a.csv": cycle(80), "b.csv": steps(150)}, cycles={"over": "strain"}, levels=LEVELS)


def test_last_makes_no_sense_after_cycles(ingest):
    with pytest.raises(SpecError, match="`last` needs samples in the order of time"):
        ingest({"a.csv": cycle(80)}, cycles={"over": "strain"}, split={"validate": {"last": 0.5}})


def test_slice_holds_what_ingest_depends_on_and_no_more():
    a = {"files": ["a.csv"]}
    same = [
        spec_of(a, fuse={"z_s": 0.1}, fit={"max_terms": 3}),
        spec_of({**a, "split": {"leave_one_level_out": True}}),
        spec_of(a, units={"torque": "N*m"}),
        spec_of(a, target={"column": "force"}),
    ]
    other = [
        spec_of({"files": ["b.csv"]}),
        spec_of(a, units={"force": "kN"}),
        spec_of(a, target={"column": "pressure"}),
    ]
    other += [
        spec_of({**a, **held(**choice)})
        for choice in ({"last": 0.5}, {"pressure": [80.0]}, {"pressure": [150.0]})
    ]
    part = recorded(slice_of(spec_of(a)))
    assert all(recorded(slice_of(one)) == part for one in same)
    damped, static = (
        slice_of(spec_of(a, target=target, needs={"static": "s.yaml"})).static
        for target in ("damping", "static")
    )
    assert (damped, static) == ("s.yaml", None)
    different = [part, *(recorded(slice_of(one)) for one in other)]
    assert all(one != another for one, another in combinations(different, 2))


def test_stage_names_its_sources_and_reports_progress(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.ingestion.files.MEGABYTE", 1)
    for name in ("b.csv", "a.csv"):
        (tmp_path / name).write_text(steps(80))
    size = len(steps(80))
    spec = spec_of({"files": ["*.csv"]})
    assert [path.name for path in INGEST.sources(spec, tmp_path)] == ["a.csv", "b.csv"]
    seen = []
    build_dataset(slice_of(spec), tmp_path, progress=lambda *step: seen.append(step))
    assert seen == [("MB read", done, 2 * size) for done in (0, size, size, 2 * size)]


@pytest.mark.parametrize("levels", [LEVELS, {"of": "pressure", "at": [84.0, 154.0, 254.0]}])
def test_a_level_goes_by_the_number_that_a_person_writes(ingest, levels):
    """At 84, 154 and 254: 150 means the level 154, and 120 none."""
    files = {f"{level}.csv": steps(level, 40) for level in (84, 154, 254)}
    dataset = ingest(files, levels=levels, **held(pressure=[150.0]))
    assert validating(dataset) == {"pressure=154": 40}
    assert "split.validate: for pressure 150, the level 154 is held out" in dataset.notes
    with pytest.raises(DataError, match="there is no level pressure=120"):
        ingest(files, levels=levels, **held(pressure=[120.0]))


# Cycles of a driven quantity
# --------------------------------------------------------------------------------------------------

SPLIT = {"longer_than": 5.0, "action": "split"}
HALF = {"validate": {"last_cycles": 0.5, "of": "pressure"}}
LENGTH = 100
"""Samples of a cycle: rest, rise, fall."""


def driven(cycles, rest=10.0, gaps=()):
    """Pressure cycles, a sample each second, with a pause of a minute before each sample of
    `gaps`.
    """
    one = np.interp(np.arange(LENGTH), [0, 20, 60, LENGTH], [0, 0, 300, 0])
    pressure = rest + np.tile(one, cycles)
    pause = np.zeros(len(pressure))
    pause[list(gaps)] = 60.0
    return csv_text(
        t=np.arange(len(pressure)) + np.cumsum(pause),
        P=pressure,
        eps=pressure / 1e4,
        F=np.arange(len(pressure)),
    )


def mask_of(dataset):
    return np.concatenate([curve.held_out for curve in dataset.curves])


def test_each_log_has_its_own_cycles(ingest):
    dataset = ingest({"a.csv": driven(2), "b.csv": driven(4, rest=40.0)}, split=HALF)
    alone = [
        mask_of(ingest({f"{n}.csv": driven(n)}, files=[f"{n}.csv"], split=HALF)) for n in (2, 4)
    ]
    np.testing.assert_array_equal(mask_of(dataset), np.concatenate(alone))


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(gaps=st.sets(st.integers(1, 399), max_size=6), share=st.sampled_from([0.25, 0.5, 0.75]))
def test_levels_and_gaps_do_not_change_which_samples_are_held_out(ingest, gaps, share):
    split = {"validate": {"last_cycles": share, "of": "pressure"}}
    levels = {"of": "pressure", "at": [10.0, 300.0], "within": 145.0}
    dataset = ingest(
        {"a.csv": driven(4, gaps=tuple(sorted(gaps)))}, gaps=SPLIT, split=split, levels=levels
    )
    number = np.concatenate([curve.columns["force"] for curve in dataset.curves])
    pressure = np.concatenate([curve.columns["pressure"] for curve in dataset.curves])
    order = np.argsort(number)
    np.testing.assert_array_equal(mask_of(dataset)[order], last_cycles(pressure[order], share))


def test_cycles_can_be_those_of_one_recording(ingest):
    split = {"validate": {"recordings": ["b"], "last_cycles": 0.5, "of": "pressure"}}
    dataset = ingest({"a.csv": driven(2), "b.csv": driven(2)}, split=split)
    assert [curve.held_out.any() for curve in dataset.curves] == [False, True]


REFUSED = {
    "one cycle": (
        driven(1),
        {},
        DataError,
        ["a.csv, cycles of pressure: 1 cycle(s)", "`last: 0.5`"],
    ),
    "no motion": (
        csv_text(t=np.arange(50), P=5, eps=0, F=0),
        {},
        DataError,
        ["a.csv, cycles of pressure: 0 cycle(s)"],
    ),
    "load cycles": (
        driven(2),
        {"cycles": {"over": "strain"}},
        SpecError,
        ["`last_cycles` needs samples in the order of time"],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_recordings_without_cycles_to_part(ingest, case):
    text, data, error, parts = REFUSED[case]
    with refused(*parts, error=error):
        ingest({"a.csv": text}, split=HALF, **data)


def test_samples_of_one_file_are_left_out_and_no_others(ingest):
    text = csv_text(t=np.arange(10), P=80, eps=0, F=0)
    files = [
        {
            "path": "a.csv",
            "keep": [{"quantity": "time", "above": 3.0}, {"quantity": "time", "below": 9.0}],
        },
        "b.csv",
    ]
    dataset = ingest(
        {"a.csv": text, "b.csv": text}, files=files, keep=[{"quantity": "time", "below": 8.0}]
    )
    assert [list(recording.columns["time"]) for recording in dataset.recordings] == [
        [4, 5, 6, 7],
        list(range(8)),
    ]
    assert [dict(recording.dropped) for recording in dataset.recordings] == [
        {"time >= 8 s": 2, "time <= 3 s": 4},
        {"time >= 8 s": 2},
    ]
