"""Thresholds of the rules of `check`, each by samples on either side."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of, dataset_of
from recorded import recording

from mapmore_cli.checking.evidence import unequal
from mapmore_cli.checking.rules import (
    Subject,
    curves,
    fits,
    odd_values,
    pairs,
    samples,
    signs,
    units,
)
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.results import Validate

UNITS = {"time": "s", "pressure": "kPa", "strain": "1", "force": "N", "u": "1"}
BASE = {
    "name": "rules",
    "data": {
        "files": ["*.csv"],
        "columns": {
            name: {"column": name, "unit": unit} if unit != "1" else {"column": name}
            for name, unit in UNITS.items()
        },
    },
    "target": {"column": "force"},
    "dictionary": [{"terms": ["1", "strain"]}],
}


def subject_of(*recordings, made=None, units=UNITS, **data):
    spec = ExperimentSpec.model_validate({**BASE, "data": {**BASE["data"], **data}})
    files = tuple(recording(f"r{k}", **columns) for k, columns in enumerate(recordings))
    return Subject(spec, lambda *loc: ".".join(map(str, loc)), files, units, Path(), "force", made)


def found(rule, *recordings, **more):
    return [
        (issue.severity, issue.id, issue.place) for issue in rule(subject_of(*recordings, **more))
    ]


ZEROS = {name: np.zeros(4) for name in UNITS}


def test_what_never_changes():
    places = {"force": ("error", "data.columns.force"), "u": ("warning", "data.columns.u")}
    for name, (severity, place) in places.items():
        moving = {other: np.arange(4) for other in UNITS if other != name}
        issue = (severity, "constant", place)
        assert found(samples.constant, moving | {name: np.ones(4)}) == [issue]
        assert (
            found(samples.constant, moving | {name: np.ones(4)}, moving | {name: np.zeros(4)}) == []
        )
    assert found(samples.constant, {name: [1.0] for name in UNITS}) == []  # of one sample


@pytest.mark.parametrize(("mean", "told"), [(3.05, True), (2.95, False), (-3.05, True)])
def test_a_target_three_ranges_from_zero(mean, told):
    issues = found(samples.offset, {"force": [mean - 0.5, mean + 0.5]}, {"force": [mean] * 5})
    assert issues == [("hint", "offset", "data.columns.force")] * told


def test_signals_that_are_one_up_to_a_factor():
    wave = np.sin(np.arange(60.0))
    for other, severity in (("force", "error"), ("strain", "hint")):
        own = {**{name: np.cos(k + np.arange(60) ** 1.5) for k, name in enumerate(UNITS)}}
        (issue,) = found(samples.same_signal, own | {"u": wave, other: 2 - 3 * wave})
        assert issue[:2] == (severity, "same-signal")


def saturated(at_end, of_another):
    values = np.linspace(0.0, 8.5, 1000)
    values[:at_end], values[at_end : at_end + of_another] = 9.0, 0.0
    return values


@pytest.mark.parametrize(
    ("at_end", "of_another", "told"),
    [(11, 1, True), (10, 1, False), (31, 3, True), (30, 3, False), (300, 1, True)],
)
def test_a_sensor_is_clipped_at_ten_times_as_many_samples_as_elsewhere(at_end, of_another, told):
    recording = ZEROS | {"force": saturated(at_end, of_another), "time": np.arange(1000)}
    issues = found(samples.clipped, {name: recording[name] for name in ("time", "force")})
    assert issues == [("warning", "clipped", "data.columns.force")] * told


@pytest.mark.parametrize(("count", "told"), [(20, False), (21, True)])
def test_up_to_a_hundredth_of_the_samples_may_lie_at_an_end(count, told):
    values = np.linspace(0.0, 8.5, 2000)
    values[:count] = 9.0
    assert bool(found(samples.clipped, {"force": values})) == told


def test_ends_near_zero_are_no_clipping():
    for end, told in ((4.4, False), (4.5, True)):
        values = np.append(np.full(200, -end), np.linspace(-end + 0.1, 9, 800))
        issues = found(samples.clipped, {"u": values})
        assert issues == [("hint", "clipped", "data.columns.u")] * told


@pytest.mark.parametrize(("above", "told"), [(0.95, True), (1.05, False)])
def test_a_force_whose_squares_pull_by_less_than_a_hundredth(above, told):
    force = np.array([np.sqrt(above), 0, -np.sqrt(99)])
    assert len(found(signs.force_never_pulls, {"force": force})) == told
    assert found(signs.force_never_pulls, {"force": np.zeros(3)}) == []
    marked = np.where(np.arange(300) % 150, 5.0, -9999)  # two marks of missing values
    assert [len(found(signs.force_never_pulls, {"force": x})) for x in (marked, -marked)] == [0, 1]
    both = subject_of({"force": 0.2 * force}, {"force": [30.0, -1.0]})
    messages = [issue.message for issue in signs.force_never_pulls(both)]
    assert len(messages) == 0  # 2 N are less than a tenth of 30 N
    both = subject_of({"force": 0.4 * force}, {"force": [30.0, -1.0]})
    messages = [issue.message for issue in signs.force_never_pulls(both)]
    assert [message.startswith("r0.csv") for message in messages] == [True] * told


@pytest.mark.parametrize(("scale", "turned"), [(2.0, "-2"), (-0.5, "0.5"), (None, "-1")])
def test_the_sign_of_a_force_is_turned_by_the_scale_of_its_column(scale, turned):
    columns = {"u": {"column": "u"}}
    columns |= {} if scale is None else {"force": {"column": "F", "scale": scale}}
    derive = {"force": "-u"} if scale is None else {}
    (issue,) = signs.force_never_pulls(
        subject_of({"force": -np.ones(9)}, columns=columns, derive=derive)
    )
    assert issue.remedy.startswith(f"write `scale: {turned}`")


def test_rules_say_nothing_without_the_quantities_that_they_look_at():
    u, rules = np.arange(40.0), [pairs.computed_from, pairs.untold_difference, samples.offset]
    rules += [signs.force_never_pulls, signs.strain_turned, units.strain_in_per_cent]
    for rule in rules:
        assert found(rule, {"u": u, "pressure": u}, {"u": u, "pressure": u}) == []
    assert found(samples.still_cycles, {"u": 0 * u}, **CYCLES) == []
    constant = subject_of({"u": u, "force": 0 * u}, {"u": u, "force": 0 * u})
    assert unequal(constant.recordings, ["u"], "force") is None
    given = {"pressure_a": "kPa", "pressure_b": "1", "u": "kPa"}
    subject = subject_of({"pressure_b": u}, units=given)
    assert [odd_values._vacuum(subject, name) for name in given] == [-101.4, None, None]


CYCLES = {"cycles": {"over": "strain"}}


@pytest.mark.parametrize(
    ("spans", "issue"),
    [
        ([1.0, 1.0], None),
        ([0.04, 0.04], "error"),
        ([0.06, 0.04], None),
        ([0.049, 0.04], "error"),
        ([0.06, None], "warning"),
        ([1.0, 0.0], "warning"),
        ([None, None], "error"),
    ],
)
def test_cycles_of_what_is_held(spans, issue):
    """Two recordings about 0 and about 1, which move by so much; None is noise."""
    ramp, noise = np.linspace(0, 1, 40), np.tile(np.repeat([0.0, 0.9], 3), 7)
    for size in (1, 10):
        recordings = [
            {"strain": size * (place + (noise if span is None else span * ramp))}
            for place, span in zip((0, 1 - (spans[1] or 0.9)), spans, strict=True)
        ]
        issues = found(samples.still_cycles, *recordings, **CYCLES)
        assert issues == ([] if issue is None else [(issue, "cycles-of-nothing", "data.cycles")])


@pytest.mark.parametrize(
    ("low", "high", "held"), [(99.0, 100.0, True), (98.9, 100.0, False), (-100.0, -99.0, True)]
)
def test_a_movement_of_a_hundredth_of_the_largest_value_is_noise(low, high, held):
    strain = {"strain": np.linspace(low, high, 40)}
    messages = [issue.message for issue in samples.still_cycles(subject_of(strain, **CYCLES))]
    assert [message.split(":")[0] for message in messages] == [
        "strain is constant in r0.csv"
    ] * held
    assert (
        found(samples.still_cycles, {"strain": np.linspace(0, 1, 40)}, {"strain": [1.0]}, **CYCLES)
        == []
    )


def test_a_copied_file_is_an_error_where_one_is_held_out():
    one, other = {"u": [1.0, 2.0], "force": [1.0, 3.0]}, {"u": [1.0, 2.0], "force": [1.0, 4.0]}
    assert found(samples.recorded_twice, one, other) == []
    assert found(samples.recorded_twice, one, one) == [("warning", "recorded-twice", "r1.csv")]
    held = curve_of(one, np.ones(2, dtype=bool), "r0"), curve_of(one, None, "r1")
    made = replace(dataset_of(one, output="force"), curves=held)
    issues = found(samples.recorded_twice, one, one, made=made)
    assert issues == [("error", "recorded-twice", "r1.csv")]


def test_a_curve_has_five_samples():
    made = dataset_of({"u": np.arange(5.0)}, {"u": np.arange(4.0)}, {"u": np.zeros(1)}, output="u")
    issues = [*curves.few_samples(subject_of(made=made))]
    told = [("few-samples", "b has 4 samples"), ("few-samples", "c has 1 sample")]
    assert [(issue.id, issue.message) for issue in issues] == told


@pytest.mark.parametrize(
    ("values", "told"),
    [([1.01], False), ([-0.01], False), ([0.5] * 30 + [1.011], True), ([-0.011, 0.5], True)],
)
def test_held_out_values_within_the_training_range(values, told):
    """A hundredth of the range from 0 to 1 may be chance."""
    training = {"strain": np.linspace(0, 1, 11), "force": np.zeros(11)}
    held = {"strain": np.array(values), "force": np.zeros(len(values))}
    parts = curve_of(training), curve_of(held, np.ones(len(values), dtype=bool), "b")
    made = replace(dataset_of(training, output="force"), curves=parts)
    split = {"split": {"validate": {"strain": [0.5]}}}
    issues = found(curves.beyond_training, ZEROS, made=made, **split)
    assert issues == [("warning", "validation-outside", "data.split.validate.strain")] * told


@pytest.mark.parametrize(
    ("model", "inputs"),
    [
        ({}, ["strain"]),
        ({"type": "literature", "name": "sarosi"}, ["pressure", "strain"]),
        ({"backbone": "sarosi"}, ["pressure", "strain"]),
    ],
)
def test_the_inputs_of_a_formula_are_inputs_of_the_model(model, inputs):
    subject = subject_of(ZEROS, made=dataset_of(ZEROS, output="force"))
    alone = {"dictionary": []} if "name" in model else {}
    spec = ExperimentSpec.model_validate({**BASE, "model": model, **alone})
    assert sorted(curves.inputs_of_model(replace(subject, spec=spec))) == inputs


@pytest.mark.parametrize(
    ("row", "told"),
    [
        *((["0", "1", "2"], False), ([" 1", "2", "", None, "3"], False), (["2", "3"], True)),
        *((["0"], True), (["1", ""], True), (["1", "x"], False), (["", None], False)),
    ],
)
def test_a_header_line_of_numbers_that_count_the_columns_is_no_sample(row, told):
    """One number counts nothing."""
    top = SimpleNamespace(is_number=lambda cell: cell.strip().isdigit())
    assert units._is_sample(row, top) is told


@pytest.mark.parametrize(
    ("unit", "told"), [("bar", False), ("bar abs", False), ("kPa", True), ("psi abs", True)]
)
def test_a_name_with_bar_may_mean_absolute_pressure(unit, told):
    columns = {**BASE["data"]["columns"], "pressure": {"column": "P_bar", "unit": unit}}
    issues = found(units.unit_in_the_name, ZEROS, columns=columns)
    assert issues == [("warning", "unit-in-name", "data.columns.pressure")] * told


@pytest.mark.parametrize(
    ("split", "day", "told"),
    [
        ({"leave_one_level_out": True}, [1, 2, 2], ["pressure is 3 in all curves"]),
        ({"leave_one_group_out": True}, [1, 2, 2], []),
        ({"leave_one_group_out": True}, [2, 2, 2], ["u is 2 in all curves"]),
        ({}, [2, 2, 2], []),
    ],
)
def test_a_level_or_group_that_is_left_out_is_not_the_only_one(split, day, told):
    columns = {"pressure": 3 * np.ones(3), "u": np.array(day), "force": np.zeros(3)}
    made = dataset_of(columns, output="force")
    curves_at = tuple(replace(curve, level=3.0) for curve in made.curves)
    made = replace(made, level="pressure", curves=curves_at)
    subject = subject_of(ZEROS, made=made, groups={"of": "u"}, split=split)
    messages = [issue.message for issue in curves.one_fold(subject)]
    assert [words in message for words, message in zip(told, messages, strict=True)] == [
        True for _ in told
    ]


def test_a_curve_of_one_place_hides_no_loop_of_another():
    there = np.linspace(0, 1, 50)
    loop = {"strain": np.append(there, there[::-1]), "force": np.append(there, there[::-1] + 1)}
    at_rest = {"strain": np.full(100, 0.5), "force": np.ones(100)}
    parts = [
        {"pressure": np.full(100, level), **columns}
        for level, columns in ((1.0, loop), (2.0, at_rest))
    ]
    made = dataset_of(*parts, output="force")
    with_levels = zip(made.curves, (1.0, 2.0), strict=True)
    leveled = tuple(replace(curve, level=level) for curve, level in with_levels)
    subject = subject_of(*parts, made=replace(made, level="pressure", curves=leveled))
    (issue,) = curves.single_valued(subject)
    assert issue.id == "not-single-valued"
    assert (" at a" in issue.message, " at b" in issue.message) == (True, False)


def test_boundaries_that_are_placed_in_one_of_two_inputs_need_samples():
    made = dataset_of({name: np.arange(9.0) for name in UNITS}, output="force")
    cuts = {"u": {"method": "even", "count": 1}, "strain": {"method": "optimal", "count": 5}}
    spec = ExperimentSpec.model_validate({**BASE, "segment": cuts})
    (issue,) = fits.short_segments(replace(subject_of(made=made), spec=spec))
    assert issue.message.startswith("a has 9 training samples: 5 segments of ")


def test_a_short_curve_is_found_beside_a_long_one():
    """With a constant and a slope, two samples are too few."""
    parts = [{name: np.arange(size) + 0.0 for name in UNITS} for size in (9, 2)]
    made = dataset_of(*parts, output="force")
    leveled = tuple(replace(curve, level=float(place)) for place, curve in enumerate(made.curves))
    made = replace(made, level="pressure", curves=leveled)
    spec = {**BASE, "data": {**BASE["data"], "levels": {"of": "pressure"}}, "fit": {"max_terms": 2}}
    subject = replace(subject_of(made=made), spec=ExperimentSpec.model_validate(spec))
    (issue,) = fits.short_segments(subject)
    assert issue.message == "b/all has 2 training samples: too few for 2 terms"


@pytest.mark.parametrize(("slope", "told"), [(-1.0, True), (1.0, False)])
def test_a_shape_along_the_levels_is_compared_with_the_data(slope, told):
    strain = np.linspace(0, 1, 20)
    parts = [
        {"pressure": np.full(20, level), "strain": strain, "force": 9 + slope * level - strain}
        for level in (1.0, 2.0, 3.0)
    ]
    made = dataset_of(*parts, output="force")
    leveled = tuple(replace(c, level=float(k)) for k, c in enumerate(made.curves, start=1))
    made = replace(made, level="pressure", curves=leveled)
    data = {**BASE["data"], "levels": {"of": "pressure"}}
    settings = {**BASE, "data": data, "fit": {"shape": {"pressure": "increasing"}}}
    subject = replace(subject_of(made=made), spec=ExperimentSpec.model_validate(settings))
    assert [issue.id for issue in fits.contradicted_shape(subject)] == ["shape"] * told


@pytest.mark.parametrize(("level", "told"), [("pressure", False), (None, True)])
def test_a_shape_is_compared_at_equal_levels(level, told):
    """At each pressure the force falls with the strain, and from one to the next both rise."""
    parts = [
        {"strain": np.linspace(0, 1, 20) + at, "force": 10 * at - np.linspace(0, 1, 20)}
        for at in (1.0, 2.0, 3.0)
    ]
    parts = [{"pressure": np.full(20, k + 1.0), **columns} for k, columns in enumerate(parts)]
    made = dataset_of(*parts, output="force")
    leveled = tuple(replace(c, level=k + 1.0) for k, c in enumerate(made.curves))
    made = replace(made, level=level, curves=leveled if level else made.curves)
    data = {**BASE["data"], **({"levels": {"of": level}} if level else {})}
    settings = {**BASE, "data": data, "fit": {"shape": {"strain": "decreasing"}}}
    subject = replace(subject_of(made=made), spec=ExperimentSpec.model_validate(settings))
    assert [issue.id for issue in fits.contradicted_shape(subject)] == ["shape"] * told


def test_a_quantity_is_there_if_every_recording_has_it():
    subject = subject_of({"u": [1.0], "force": [1.0]}, {"u": [2.0]})
    assert (subject.has("u"), subject.has("force"), subject.has("u", "force")) == (
        True,
        False,
        False,
    )


def test_a_few_samples_of_another_input_may_lie_outside():
    training = {"strain": np.linspace(0, 1, 11), "u": np.arange(11.0), "force": np.zeros(11)}
    for outside, told in ((5, False), (6, True)):
        strain = np.where(np.arange(100) < outside, 1.5, 0.5)
        held = {"strain": strain, "u": np.full(100, 5.0), "force": np.zeros(100)}
        parts = curve_of(training), curve_of(held, np.ones(100, dtype=bool), "b")
        made = replace(dataset_of(training, output="force"), curves=parts)
        subject = subject_of(ZEROS, made=made, split={"validate": {"u": [5]}})
        messages = [issue.message for issue in curves.beyond_training(subject)]
        share = "6% of the validation samples have strain 1.5, outside the training range 0 to 1"
        assert messages == [share] * told


@pytest.mark.parametrize(("count", "told"), [(0, False), (1, True), (4, True), (5, False)])
def test_a_formula_needs_as_many_samples_as_it_has_parameters(count, told):
    """A plane in pressure and strain with a bend in the pressure has five."""
    columns = {"strain": np.zeros(9), "pressure": np.zeros(9), "force": np.zeros(9)}
    made = dataset_of(columns, held_out=np.arange(9) >= count, output="force")
    subject = subject_of(ZEROS, made=made)
    validation = Validate(against=["polynomial_2"])
    spec = subject.spec.model_copy(update={"validation": validation})
    issues = [*fits.few_for_formula(replace(subject, spec=spec))]
    assert [(issue.id, issue.place) for issue in issues] == [
        ("few-for-formula", "validate.against.0")
    ] * told


def test_the_strain_is_compared_with_the_force_at_equal_pressure():
    """A partial correlation is that of what a straight line of the third signal leaves."""
    x, y, z = np.random.default_rng(0).normal(size=(3, 50)) + np.linspace(0, 2, 50)
    r = np.corrcoef([x, y, z])
    line = np.column_stack([np.ones(50), z])
    left = [v - line @ np.linalg.lstsq(line, v, rcond=None)[0] for v in (x, y)]
    assert signs._partial(r[0, 1], r[0, 2], r[1, 2]) == pytest.approx(np.corrcoef(left)[0, 1])
    assert signs._partial(0.3, 1.0, 0.3) == 0


def test_no_gauge_shows_less_than_a_vacuum():
    for (unit, size), (lowest, told) in product(
        [("kPa", 1.0), ("bar", 100.0), ("psi", 6.894757)], [(-101.3, False), (-101.5, True)]
    ):
        recording = {"pressure": [0.0, 5.0, lowest / size], "u": [-500.0] * 3}
        issues = found(odd_values.below_vacuum, recording, units={**UNITS, "pressure": unit})
        assert issues == [("warning", "below-vacuum", "data.columns.pressure")] * told
    subject = subject_of({"pressure": [0.0, -500.0, -300.0], "time": [0.0, 0.25, 0.5]})
    (issue,) = odd_values.below_vacuum(subject)
    assert issue.message.startswith("r0.csv:row 3 (time 0.25 s) and 1 more: pressure is -500 kPa")
    subject = subject_of({"pressure": [0.0, -500.0]}, every=2)
    (issue,) = odd_values.below_vacuum(subject)
    assert issue.message.startswith("r0: sample 2: pressure")


@pytest.mark.parametrize(
    ("fill", "count", "told"),
    [
        *((-9999, 2, True), (-9999, 1, False), (-9999, 10, True), (-9999, 11, False)),
        *((9999, 2, True), (-4.9, 2, False), (-5.1, 2, True), (6.1, 2, True)),
    ],
)
def test_a_number_far_from_all_others_stands_for_a_missing_value(fill, count, told):
    values = np.append(np.linspace(0, 1, 100 - count), [fill] * count)
    for size in (1.0, 0.01):
        issues = found(odd_values.fill_values, {"force": size * values, "time": values})
        assert issues == [("warning", "fill-value", "data.columns.force")] * told
    two_values = np.append(np.zeros(90), np.ones(10))  # a valve
    step = np.append(np.zeros(5), np.linspace(99, 101, 95))
    for values in (two_values, step):
        assert found(odd_values.fill_values, {"force": values}) == []


@pytest.mark.parametrize(("unit", "whole"), [("1", 1.0), ("%", 100.0)])
@pytest.mark.parametrize(
    ("share", "told"), [(1.0, []), (1.01, ["strain reaches 1.01, which is 101 %"])]
)
def test_a_muscle_contracts_by_less_than_its_length(unit, whole, share, told):
    subject = subject_of({"strain": [0.0, share * whole]}, units={**UNITS, "strain": unit})
    messages = [issue.message for issue in units.strain_in_per_cent(subject)]
    assert [message[:35] for message in messages] == told


@pytest.mark.parametrize(("error", "told"), [(0.9e-4, True), (1.1e-4, False)])
def test_a_target_that_is_a_line_of_a_column_in_each_recording(error, told):
    wave = np.sin(np.arange(60.0))
    odd = np.where(np.arange(60) % 2, 1.0, -1.0)
    odd -= wave * (odd @ wave) / (wave @ wave)
    force = [3 * wave + offset + np.ptp(3 * wave) * error * odd for offset in (0, 5)]
    recordings = [{"u": wave, "force": values} for values in force]
    issues = found(pairs.computed_from, *recordings)
    assert issues == [("warning", "computed-from", "data.columns.force")] * told
    steeper = [recordings[0], {"u": wave, "force": 3.01 * wave}]
    assert found(pairs.computed_from, *steeper) == []
    assert pairs._slope_of_line(wave[:29], 3 * wave[:29]) is None
    assert pairs._slope_of_line(wave[:30], 3 * wave[:30]) == pytest.approx(3)
    assert pairs._slope_of_line(np.ones(40), wave[:40]) is None


@pytest.mark.parametrize(
    ("effect", "line"),
    [
        (lambda y: 0.6 * y, "`data.groups: {of: session, gain: true}` and "),
        (lambda y: y + 1, "`data.groups: {of: session, offset: true}` and "),
        (lambda y: 0.6 * y + 5, "`data.groups: {of: session, offset: true, gain: true}` and "),
        (lambda y: y[::-1], ""),
    ],
)
def test_a_difference_between_sessions_is_told_with_what_explains_it(effect, line):
    u = np.sin(np.arange(60.0)) + 2
    both = subject_of({"u": u, "force": u}, {"u": u, "force": effect(u)})
    (issue,) = pairs.untold_difference(both)
    assert issue.remedy.startswith(f"write {line}`set: {{session: 1}}`")


def test_inputs_that_are_equal_are_told_in_the_order_of_the_alphabet():
    u = np.sin(np.arange(60.0))
    columns = {name: {"column": name} for name in ("force", *"ebdac")}
    parts = [{**dict.fromkeys("ebdac", u), "force": force} for force in (u, u + 1)]
    (issue,) = pairs.untold_difference(subject_of(*parts, columns=columns))
    assert "has the same a, b, c, d, e as" in issue.message


@pytest.mark.parametrize(("lowest", "told"), [(-101.4, True), (-101.5, False)])
def test_a_spike_below_the_vacuum_is_told_by_another_rule(lowest, told):
    pressure = np.where(np.arange(60) == 30, lowest, np.arange(60) % 3.0)
    assert bool(found(odd_values.spikes_in, {"pressure": pressure})) == told
