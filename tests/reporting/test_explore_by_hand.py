"""Numbers and sentences that the page `explore` is given, by hand."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of
from export_samples import SAROSI
from report_builder import build
from test_memory_report import report_of

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Quantity, Signal
from mapmore_cli.modelling.literature.model import formula_equations
from mapmore_cli.modelling.validation.intervals import left_out_summary
from mapmore_cli.reporting import competitors, explore
from mapmore_cli.reporting import explore_data as data


@pytest.fixture(scope="module")
def inputs():
    return build(samples=20)


@pytest.mark.parametrize(
    ("low", "high", "ends", "near"),
    [
        (2, 4, [1.7, 4.3], 0.12),
        (4, 4, [3.4, 4.6], 0),
        (-4, -4, [-4.6, -3.4], 0),
        (0, 0, [-0.15, 0.15], 0),
    ],
)
def test_an_input_goes_beyond_its_range(low, high, ends, near):
    reach = data._reach(low, high)
    assert reach["ends"] == pytest.approx(ends)
    assert reach["near"] == pytest.approx(near + 1e-12)


def test_knobs_have_steps_and_start_somewhere():
    assert data._knob("a", (1.0, 3.0), 2.12345678) == {
        "name": "a", "low": 1, "high": 3, "step": 0.004, "value": 2.123457,
    }  # fmt: skip
    assert data._knob_of_input("p", (2, 4), 3.0) == data._knob("input:p", [1.7, 4.3], 3.0)
    swing = data._swing("p", 2.0)
    assert [swing[key] for key in ("name", "low", "high", "value")] == ["amplitude:p", 0, 1.3, 0.8]
    assert data._swing("p", 0.0)["high"] == 0.65
    assert data._numbers(np.array([np.nan, np.inf, 12.3456789])) == [None, None, 12.34568]


def test_spans_and_texts_of_quantities():
    curves = [curve_of({"x": np.array([np.nan, 3.0, -1.0])}), curve_of({"x": np.array([7.0])})]
    assert data._span(curves, "x") == (-1, 7)
    assert data._span([curve_of({"x": np.array([np.nan])})], "x") == (0, 1)
    labels = SimpleNamespace(axis_label=lambda one: {"a_b": "$a$ (N)"}.get(one.name, one.name))
    first = data._quantity(Quantity("a_b", "N"), labels)
    assert first == {"name": "a_b", "title": "a b", "unit": "N", "label": "A b (N)"}
    assert data._quantity(Quantity("c", "1"), labels)["unit"] == ""
    assert data._quantity(Quantity("c", "1"), labels)["label"] == "c"


def test_rates_are_per_second_of_the_clock_of_the_model(inputs):
    """Of a clock in ms, with rates in half the unit per second."""
    rate = Signal("strain_rate", "rate", "strain", 0.1, 2, factor=2.0, seconds=1e-3)
    study = data.study_of(replace(inputs, model=replace(inputs.model, signals=(rate,))), "a")
    assert study["signals"] == {"strain_rate": {"kind": "rate", "of": "strain", "factor": 0.002}}


def test_inputs_over_time_swing_about_the_middle_of_their_range_in_periods_of_many_steps():
    """The model has a time step of 0.01 s."""
    study = data.study_of(running := report_of(["pressure", "motion[k-1]"]), "a")
    low, high = data._span(running.dataset.curves, "pressure")
    offset, amplitude = study["knobs"]["pressure"]
    assert offset["value"] == pytest.approx((low + high) / 2, rel=1e-6)
    assert amplitude["value"] == pytest.approx(0.4 * (high - low), rel=1e-6)
    rate = study["frequency"]
    assert rate["value"] == pytest.approx(1 / (500 * 0.01))
    assert [rate["low"], rate["high"]] == pytest.approx([rate["value"] / 20, rate["value"] * 5])


def test_a_page_draws_over_the_input_that_varies_within_a_curve(inputs):
    """Whichever input the model names first; over the first one if none of them varies."""
    for order in (inputs.model.inputs, inputs.model.inputs[::-1]):
        study = replace(inputs, model=replace(inputs.model, inputs=order))
        assert data.study_of(study, "a")["along"] == "strain"
    validation = replace(inputs.validation, along="force")
    first = data.study_of(replace(inputs, validation=validation), "a")["along"]
    assert first == inputs.model.inputs[0].name


def spans_of(study):
    curves = study.dataset.curves
    return {one.name: data._span(curves, one.name) for one in study.model.inputs}


def test_samples_are_thinned_and_begin_at_the_middle_of_the_first_held_out_curve(
    inputs, monkeypatch
):
    monkeypatch.setattr(data, "MOST_TRAINED", 7)
    monkeypatch.setattr(data, "MOST_SAMPLES", 7)
    curves = inputs.dataset.curves
    found = data._samples(inputs, spans_of(inputs))
    trained, held = found["samples"]["trained"], found["samples"]["held"]
    assert (len(trained["force"]), len(held["force"])) == (7, 7)  # every ninth of 60, third of 20
    (out,) = (curve for curve in curves if curve.held_out.any())
    assert held["strain"] == pytest.approx(out.columns["strain"][::3], rel=1e-6)
    assert found["samples"]["all_held"] == 20
    assert [knobs[0]["value"] for knobs in found["knobs"].values()] == pytest.approx(
        [out.columns[name][10] for name in found["knobs"]], rel=1e-6
    )
    assert [*found["buttons"]] == ["Held-out curve", "Worst held-out sample"]


def test_buttons_lead_to_the_middles_of_held_out_curves_and_to_the_worst_sample():
    study = build(samples=20, held_out=lambda level, strain: np.full(len(strain), level != 150))
    curves = study.dataset.curves
    found = data._samples(study, spans_of(study))
    (trains,) = (curve for curve in curves if curve.training.any())
    assert found["samples"]["trained"]["strain"] == pytest.approx(
        trains.columns["strain"], rel=1e-6
    )
    middles = [
        [curve.columns[name][10] for name in found["knobs"]]
        for curve in curves
        if curve is not trains
    ]
    places = json.loads(found["buttons"]["Held-out curve"])
    assert places == [pytest.approx(place, rel=1e-6) for place in (*middles[1:], middles[0])]
    errors = [
        np.abs(values - curve.columns["force"])
        for values, curve in zip(study.validation.predictions["mapmore"], curves, strict=True)
        if curve is not trains
    ]
    held = [curve for curve in curves if curve is not trains]
    worst = int(np.argmax([each.max() for each in errors]))
    at = [held[worst].columns[name][errors[worst].argmax()] for name in found["knobs"]]
    (place,) = json.loads(found["buttons"]["Worst held-out sample"])
    assert place == pytest.approx(at, rel=1e-6)
    alone = build(samples=20, held_out=lambda _level, strain: np.zeros(len(strain), dtype=bool))
    found = data._samples(alone, spans_of(alone))
    assert [*found["buttons"]] == ["Worst sample"]
    ends = data._span(alone.dataset.curves, "strain")
    assert found["knobs"]["strain"][0]["value"] == pytest.approx(sum(ends) / 2)


@pytest.mark.parametrize(
    ("held", "step", "u", "name", "begins", "rest"),
    [
        ([0, 0, 1, 1], 0.5, [4, 6.5], "a, held out", 30, 60),
        ([0, 0, 0, 0], 1.0, [0, 4, 7], "a", 10, 30),
        ([0, 0, 0, 0], 0.001, None, "a", 10, 20_000),
    ],
)
def test_a_record_begins_at_its_held_out_part_in_even_steps(
    held, step, u, name, begins, rest, monkeypatch
):
    monkeypatch.setattr(data, "program_of", lambda _model: SimpleNamespace(step=step))
    monkeypatch.setattr(data, "_begins", lambda _inputs: "begins")
    columns = {
        "time": np.array([0.0, 0.4, 1.0, 1.6]),
        "u": np.array([0.0, 2.0, 4.0, 7.0]),
        "y": np.array([10.0, np.nan, 30.0, 40.0]),
    }
    model = SimpleNamespace(inputs=[Quantity("u", "1")], output=Quantity("y", "1"))
    curves = [curve_of(columns), curve_of(columns, np.array(held, dtype=bool))]
    found = data._record(SimpleNamespace(model=model), curves)
    assert (found["name"], found["start"], found["rest"]) == (name, begins, rest)
    if u is None:
        assert len(found["columns"]["u"]) == 1601
        assert found["at_rest"] == "at rest after 20 s at the offset"
    else:
        assert found["columns"]["u"] == pytest.approx(u)
        assert found["at_rest"] == "at rest after 30 s at the offset"


def stub(step=None, output="force", inputs=("pressure",), segments=0):
    memories = [] if step is None else [SimpleNamespace(states=SimpleNamespace(step=step))]
    return SimpleNamespace(
        inputs=[Quantity(name, "1") for name in inputs], output=Quantity(output, "N"), every=(),
        memories=memories, pieces=SimpleNamespace(segments=range(segments)),
    )  # fmt: skip


def test_competitors_that_a_page_computes_have_the_output_the_inputs_and_the_step_of_the_model():
    models = {
        "same": stub(0.1), "static": stub(), "slower": stub(0.2), "other": stub(output="strain"),
        "more": stub(inputs=("pressure", "strain")), "long": stub(segments=101),
        "most": stub(segments=100), "unseen": stub(),
    }  # fmt: skip
    shown = [name for name in models if name != "unseen"]
    validation = SimpleNamespace(models=models)
    inputs = SimpleNamespace(model=stub(0.1), validation=validation, models=shown)
    assert [*explore._competitors(inputs)] == ["same", "static", "most"]


def test_models_without_code_are_left_out_and_no_program_is_run(inputs, monkeypatch):
    validation = replace(inputs.validation, models={"sarosi": inputs.model})
    study, written = replace(inputs, validation=validation), explore.wrapped

    def wrapped(key, *model):
        if key in unwritten:
            raise DataError("no closed expression", "choose another model")
        return written(key, *model)

    def run(*_, **__):
        raise AssertionError("another program is run")

    monkeypatch.setattr(explore, "wrapped", wrapped)
    monkeypatch.setattr("subprocess.Popen", run)
    unwritten = []
    (found,) = explore.explored([study]).outputs
    assert [one["key"] for one in found["others"]] == ["model0.0"]
    unwritten.append("model0.0")
    (found,) = explore.explored([study]).outputs
    assert found["others"] == []
    unwritten.append("model0")
    assert explore.explored([study]) is None


def test_formulas_that_were_fitted_one_after_the_other_stand_below_each_other():
    fits = {"a (static)": SAROSI, "a (damping)": SAROSI, "a": SAROSI, "b": SAROSI, "ab": SAROSI}
    unknown = replace(SAROSI, name="nobody's")
    inputs = SimpleNamespace(
        models=("mapmore", "a", "c", "d", "lost"), failed=("lost",),
        validation=SimpleNamespace(models={}, formulas=fits | {"d": unknown}),
    )  # fmt: skip
    several, none, other = competitors.printed_competitors(inputs)
    assert several.equations == 3 * formula_equations(SAROSI, {})
    assert (several.words, none.words) == ((), (competitors.NOT_KNOWN,))
    assert (other.equations, other.words) == ((), (competitors.NOT_KNOWN,))


def test_what_a_run_begins_with(inputs, monkeypatch):
    monkeypatch.setattr(data, "fed_back", lambda model: model in fed)
    rival = SimpleNamespace()
    validation = replace(inputs.validation, models={"rival": rival})
    study = replace(inputs, validation=validation)
    fed = [inputs.model]
    assert data._begins(study).startswith("A run begins with as many values of force")
    fed = [rival]
    assert "begins at rest, without measured force. A competitor" in data._begins(study)
    fed = []
    assert data._begins(study).endswith("begins at rest, without measured force.")


def test_intervals_stand_at_even_levels(inputs, monkeypatch):
    assert data._interval(inputs) is None
    assert data._no_interval(inputs).endswith("does not ask for one (validate: {intervals: true}).")
    left_out = left_out_summary("recordings", 3, {"a": [np.ones(3)]})
    study = SimpleNamespace(
        left_out=left_out, dataset=inputs.dataset, model=SimpleNamespace(level="pressure")
    )
    monkeypatch.setattr(data, "half_widths_of", lambda _model, columns, _level: columns["pressure"])
    found = data._interval(study)
    low, high = data._span(inputs.dataset.curves, "pressure")
    assert (found["of"], found["low"], found["level"]) == ("pressure", low, 0.95)
    assert found["step"] == pytest.approx((high - low) / 40)
    assert found["half"] == pytest.approx(low + found["step"] * np.arange(41), rel=1e-6)
    study.model.level = None
    monkeypatch.setattr(data, "half_widths_of", lambda _model, columns, _level: columns["row"])
    found = data._interval(study)
    assert (found["of"], found["half"]) == (None, [0.0] * 41)
    one_level = [curve_of({"pressure": np.full(3, 200.0)})]
    study.model.level, study.dataset = "pressure", SimpleNamespace(curves=one_level)
    monkeypatch.setattr(data, "half_widths_of", lambda _model, columns, _level: columns["pressure"])
    assert (data._interval(study)["of"], data._interval(study)["low"]) == (None, 200)
