"""Along which quantity a report shows curves, and which samples of long curves it keeps."""

from itertools import pairwise
from types import SimpleNamespace

import pytest
from surfaces import QUANTITIES, built, curves

from mapmore_cli.domain.recording import Dataset, Recording
from mapmore_cli.domain.results import Validation
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.validation import shown
from mapmore_cli.modelling.validation.shown import course_quantity, is_turned, varying_input

RANGES = [
    {"a": (0.0, 1.0), "b": (0.0, 9.0), "d": (0.0, 8.98)},
    {"a": (3.0, 5.0), "b": (1.0, 10.0), "c": (2.0, 2.0), "d": (1.0, 10.0)},
]


@pytest.mark.parametrize(
    ("inputs", "level", "segmented", "found"),
    [
        ("ab", None, None, "b"),  # a curve covers .3 of the range of a and .9 of that of b
        ("db", None, None, "d"),  # .899 is as good as .9, so the first is taken
        ("ab", "b", None, "a"),
        ("ab", None, ("a", "b"), "a"),
        ("ab", None, (), "b"),
        ("c", "c", None, "c"),  # the level is the only input
        ("cx", None, None, "c"),  # neither varies
        ("", None, None, ""),
    ],
)
def test_curves_are_shown_along_the_input_of_which_each_covers_most(
    inputs, level, segmented, found
):
    pieces = None if segmented is None else SimpleNamespace(variables=segmented)
    model = SimpleNamespace(input_names=tuple(inputs), level=level, pieces=pieces)
    assert varying_input(model, RANGES) == found


def test_a_model_without_inputs_is_shown_along_any_quantity_but_the_time_and_its_target():
    model = SimpleNamespace(input_names=(), level=None, pieces=None)
    names = dict.fromkeys(("time", "force", "strain"))
    assert course_quantity(model, Dataset("force", None, names, (), ())) == "strain"
    del names["strain"]
    assert course_quantity(model, Dataset("force", None, names, (), ())) == "force"


def test_a_model_is_inverted_if_the_target_is_one_of_its_inputs():
    inputs = ("pressure", "strain")
    for target, output, turned in (
        ("strain", "force", True), ("force", "force", False), ("strain", "strain", False)
    ):  # fmt: skip
        model = SimpleNamespace(input_names=inputs, output=SimpleNamespace(name=output))
        assert is_turned(model, Dataset(target, None, {}, (), ())) == turned


def test_step_responses_and_models_that_run_over_time_are_shown_over_time(monkeypatch):
    step, curve = SimpleNamespace(at_rest=[True]), SimpleNamespace(at_rest=None)
    for runs, made, found in (
        (False, [curve], False),
        (False, [curve, step], True),
        (True, [curve], True),
    ):
        monkeypatch.setattr(shown, "runs_over_time", lambda _model, runs=runs: runs)
        assert shown.in_time(None, Dataset("force", None, {}, (), made)) == found


@pytest.mark.parametrize(("turned", "order"), [(False, "strain"), (True, "force")])
def test_residuals_of_an_inverted_model_are_in_the_order_of_its_output(turned, order, monkeypatch):
    asked = []
    monkeypatch.setattr(shown, "is_turned", lambda *_: turned)
    monkeypatch.setattr(shown, "residual_tests", lambda *given: asked.append(given[-1]) or ())
    samples = curves()
    given = Dataset("force", "pressure", QUANTITIES, (), samples)
    own = tuple(one.columns["force"] for one in samples)
    shown.for_report(Validation({"mapmore": own}, {}, (), {}), built(), given)
    assert asked == [order]


@pytest.mark.parametrize("most", [120, 40])
def test_of_long_curves_the_extremes_of_values_and_errors_are_kept(most, monkeypatch):
    """In each of ten parts of the 120 samples of a curve. The log is thinned as well."""
    monkeypatch.setattr(shown, "MANY", most)
    samples, model = curves(), built()
    log = Recording("r", "r.csv", dict(samples[0].columns), 120, {})
    short = Recording("s", "s.csv", {name: x[:30] for name, x in log.columns.items()}, 30, {})
    given = Dataset("force", "pressure", QUANTITIES, (log, short), samples)
    own = tuple(predict(model, one.columns) for one in samples)
    made = shown.for_report(Validation({"mapmore": own}, {}, (), {}), model, given)
    assert (made.along, len(made.bands) > 0) == ("strain", True)
    assert {test.name for test in made.residual_tests} == {"autocorrelation", "strain"}
    if most == 120:
        assert made.shown is None
        assert made.predictions["mapmore"] is own
        return
    for one, kept, values in zip(
        samples, made.shown.curves, made.predictions["mapmore"], strict=True
    ):
        force = one.columns["force"]
        expected = set()
        for start, end in pairwise(range(0, 121, 12)):
            for drawn in (force, predict(model, one.columns) - force):
                part = drawn[start:end]
                expected |= {start + int(part.argmin()), start + int(part.argmax())}
        assert kept.columns["force"].tolist() == force[sorted(expected)].tolist()
        assert values == pytest.approx(predict(model, kept.columns))
    assert 20 < made.shown.recordings[0].rows_kept <= 40
