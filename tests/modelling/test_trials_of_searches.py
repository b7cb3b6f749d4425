"""Trials of a structure: which models are refused, what counts as an error, how placeholders are
filled in, and when a black box is clearly better.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of, dataset_of

from mapmore_cli.annexes.search import trying
from mapmore_cli.annexes.search.candidate import filled
from mapmore_cli.annexes.search.further import outdone_note
from mapmore_cli.domain.results import Forecast, Search, Tried

U, Y = np.array([0.0, 1] * 4), np.linspace(2, 8, 8)


def refusal(monkeypatch, run, *, fed_back=True, timed=True, exploding=()):
    """Why a model with the predictions `run(u, y)` is refused, if outputs are between 0 and 10."""
    data = dataset_of({"u": U, "y": Y})
    found = SimpleNamespace(
        dataset=data,
        study=data,
        range=(0.0, 10.0),
        situation=SimpleNamespace(inputs=("u",), timed=timed),
    )
    columns = ("u", "y")
    fakes = {
        "fed_back": lambda _model: fed_back,
        "runs_over_time": lambda _model: True,
        "exploding_curves": lambda *_: exploding,
        "forecast": lambda _model, curve: Forecast.of(run(*map(curve.columns.get, columns))),
    }
    for name, fake in fakes.items():
        monkeypatch.setattr(trying, name, fake)
    return trying._refusal(None, found)


@pytest.mark.parametrize(
    ("value", "refused"), [(20.0, False), (20.1, True), (-10.0, False), (-10.1, True)]
)
def test_predictions_may_leave_the_range_by_its_width(value, refused, monkeypatch):
    """Outputs lie between 0 and 10; the middle is 5, and 1.5 widths around it are allowed."""
    found = refusal(monkeypatch, lambda u, _: np.full(len(u), value), fed_back=False, timed=False)
    assert found.startswith("diverges at inputs of the study") == refused
    assert not refusal(monkeypatch, lambda u, _: np.full(len(u), value), fed_back=False)


def test_a_model_that_explodes_beyond_a_curve_is_refused(monkeypatch):
    found = refusal(monkeypatch, lambda u, _: np.full(len(u), 5.0), exploding=("a",))
    assert found == "diverges beyond the ends of its curves"


@pytest.mark.parametrize(("limit", "refused"), [(1.095, True), (1.105, False)])
def test_inputs_are_enlarged_by_a_fifth_about_their_middle(limit, refused, monkeypatch):
    """Inputs from 0 to 1 become inputs from -0.1 to 1.1."""
    for away in (lambda u: (U > 0) & (u > limit), lambda u: (U < 1) & (u < 1 - limit)):
        found = refusal(monkeypatch, lambda u, _, away=away: np.where(away(u), 99.0, 5.0))
        assert found.startswith("runs away") == refused


@pytest.mark.parametrize(
    ("late", "refused"), [([0.11, -0.11] * 2, True), ([0.09, -0.09] * 2, False), ([1.0] * 4, False)]
)
def test_a_tenth_of_the_start_may_still_oscillate_in_the_second_half(late, refused, monkeypatch):
    """The second run starts a tenth of the range, that is 1, higher; an offset stays."""
    apart = np.array([1.0, -1, 1, -1, *late])
    found = refusal(monkeypatch, lambda _, y: 5 + apart * np.isclose(y, Y + 1))
    assert found.startswith("oscillates by itself") == refused


def test_errors_are_infinite_after_a_divergence_and_missing_without_a_past(monkeypatch):
    curve, out = curve_of({"y": np.ones(5)}), np.arange(5) < 4
    said = Forecast(np.array([np.nan, 3, np.nan, np.inf, 9]), ready=np.arange(5) > 0)
    monkeypatch.setattr(trying, "missed_by", lambda *_: [(curve, out, said), (curve, ~out, said)])
    errors = trying._errors(None, SimpleNamespace(target="y"), [])
    np.testing.assert_array_equal(errors, [np.nan, 2, np.inf, np.inf, 8])


def test_placeholders_are_filled_in():
    words = {"NONE": [], "TWO": ["p", "q"], "N": 3}
    template = [
        "TWO",
        "u[k-N]",
        {"slow": {"of": "NONE", "count": 2}},
        {"spline": {"of": "u", "with": "NONE"}},
        {"every": "play(NAME, WIDTH)", "NAME": "TWO", "WIDTH": [1, 2]},
    ]
    plays = ["play(p, 1)", "play(p, 2)", "play(q, 1)", "play(q, 2)"]
    expected = ["p", "q", "u[k-3]", {"spline": {"of": "u"}}, *plays]
    assert filled(template, words) == expected


@pytest.mark.parametrize(("box", "noted"), [(0.89, True), (0.91, False)])
@pytest.mark.parametrize("asks_parts", [True, False])
def test_a_black_box_is_noted_if_its_error_is_a_tenth_smaller(box, noted, asks_parts):
    """On the kind of folds that resemble the held-out data."""
    kind = "parts" if asks_parts else "error"
    tried = (Tried("surface", "a", {}, **{kind: 1.0}), Tried("black box", "b", {}, **{kind: box}))
    found = Search("search", "y", "", "", 1.0, tried, 0, 0)
    assert bool(outdone_note(found, SimpleNamespace(asks_parts=asks_parts))) == noted
