"""Tables of segments, terms, coefficients, bands, and far samples, from numbers by hand."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mapmore_cli.domain.fits import SegmentedCurve
from mapmore_cli.domain.models import Equation
from mapmore_cli.domain.recording import Dataset, Quantity
from mapmore_cli.domain.results import ErrorBand, Outlier, Search, Tried
from mapmore_cli.domain.scores import REPEATABILITY, Score
from mapmore_cli.reporting import sections, summary
from mapmore_cli.reporting.fit_tables import (
    coefficients_table,
    outliers_table,
    segment_ends,
    segments_table,
    terms_table,
    training_rmse,
)
from mapmore_cli.reporting.memory_tables import identified_table, states_table
from mapmore_cli.reporting.score_tables import (
    changes_table,
    drift_table,
    score_table,
    search_table,
)
from mapmore_cli.reporting.tables import (
    bands_table,
    equations_table,
    limits_tables,
    pieces_table,
    shape_table,
)


def piece(name="s", stop="tolerance", tied=(0, 2)):
    """Two terms of three, of which the second has no runner-up."""
    selection = SimpleNamespace(
        err=np.array([0.9, 0.05]),
        err_all=np.array([[0.9, 0.1, 0.85], [0.0, 0.05, 0.02]]),
        runner_up=np.array([2, -1]),
        tied=np.array(tied),
        stop=stop,
        sse=8.0,
        samples=2,
        condition=3.0,
        freedom=4,
        errors_note="how errors were found",
        table=lambda: [
            {"coefficient": -2.0, "standard_error": 0.5, "t": -4.0},
            {"coefficient": -1.0, "standard_error": 0.5, "t": -2.0},
        ],
    )
    scaling = SimpleNamespace(y_slope=-10.0, rule="unit_square", placement="left")
    candidates = ("1", "x", "x^2")
    return SimpleNamespace(
        id=name,
        selection=selection,
        candidates=candidates,
        terms=("1", "x"),
        scaling=scaling,
    )


def test_terms_with_their_shares_and_the_runner_up():
    table = terms_table(SimpleNamespace(pieces=[piece()]))
    first, second = map(list, table.rows)
    assert first[:3] == ["s", 1, "1"]
    assert first[3:5] == pytest.approx([90, 90])
    assert first[5] == "x^2"
    assert first[6:8] == pytest.approx([85, 5])
    assert first[8:] == [None, None]
    assert second[:3] == ["s", 2, "x"]
    assert second[3:5] == pytest.approx([5, 95])
    assert second[5] is None
    assert np.isnan(second[6:8]).all()
    assert second[8:] == [2, "tolerance"]
    assert len(table.notes) == 2
    untied, tied = piece(tied=(0, 0)), piece("t")
    assert len(terms_table(SimpleNamespace(pieces=[untied])).notes) == 1
    assert len(terms_table(SimpleNamespace(pieces=[untied, tied])).notes) == 2
    untied.selection.runner_up = np.array([0, -1])
    assert terms_table(SimpleNamespace(pieces=[untied])).rows[0][5] == "1"  # the first candidate


def test_coefficients_with_their_intervals_in_both_units():
    reach = 2.7764451051977987 * 0.5  # Student's t of four degrees of freedom, both sides 95 %
    table = coefficients_table(SimpleNamespace(pieces=[piece()]), "N")
    first, second = table.rows
    assert first[:2] == ("s", "1")
    assert first[2:] == pytest.approx(
        (-2, 0.5, -4, reach, -2 - reach, -2 + reach, 20, 10 * reach), rel=1e-9
    )
    assert second[2:] == pytest.approx(
        (-1, 0.5, -2, reach, -1 - reach, -1 + reach, 10, 10 * reach), rel=1e-9
    )
    assert table.notes == (
        "how errors were found",
        "Not identified (95 % interval beyond zero): x (s).",
    )
    assert table.headings[-2:] == ("theta × y_slope [N]", "± 95 % [N]")
    plain = piece()
    plain.scaling.rule = "none"  # the coefficient of x has the unit of y per unit of x
    unscaled = coefficients_table(SimpleNamespace(pieces=[piece("t"), plain]), "N")
    assert unscaled.headings[-2:] == ("theta × y_slope", "± 95 %")
    for count, more in ((12, False), (13, True)):
        every = SimpleNamespace(pieces=[piece(str(number)) for number in range(count)])
        named = coefficients_table(every, "N").notes[-1]
        assert named.count("x (") == 12
        assert named.endswith(", ....") is more


CURVE = SegmentedCurve(
    "c", None, {}, (np.array([0.0, 1.0, 3.0]), np.array([5.0, 7.0])), ("x", "z"), ()
)


def test_segments_with_their_ends_and_their_error_in_the_unit_of_the_target():
    last = SimpleNamespace(id="s", cell=(2, 1))
    assert segment_ends(CURVE, last) == [1, 3, 5, 7]
    assert segment_ends(CURVE, SimpleNamespace(cell=(1, 1))) == [0, 1, 5, 7]
    assert training_rmse(piece()) == 20
    rounded = piece()
    rounded.selection.sse = -1e-20
    assert training_rmse(rounded) == 0
    quantities = {name: Quantity(name, unit) for name, unit in (("x", "mm"), ("z", "kPa"))}
    table = segments_table(
        SimpleNamespace(
            segmentation=[replace(CURVE, segments=(last,))],
            dataset=Dataset("y", None, quantities, (), ()),
            fit=SimpleNamespace(segments=[piece()]),
            target=Quantity("y", "N"),
        )
    )
    (row,) = table.rows
    assert row == ("s", 2, 1, 3, 5, 7, 20, "unit_square", "left", 3)
    assert "RMSE [N]" in table.headings


def test_bands_and_far_samples():
    bands = [ErrorBand(0.0, 1.0, 3, {"a": 0.5}), ErrorBand(1.0, 2.0, 4, {"a": math.nan, "b": 0.2})]
    table = bands_table(bands, "N")
    assert table.headings == ("from [N]", "to [N]", "samples", "a [N]")
    assert table.rows[0] == (0, 1, 3, 0.5)
    assert table.rows[1][:3] == (1, 2, 4)
    assert not bands_table([], "N").rows
    (row,) = outliers_table([Outlier("a.csv", "row 7", "c", -1.5, 6.0)], "N").rows
    assert row == ("a.csv", "row 7", "c", -1.5, 6.0)


@pytest.mark.parametrize("weight", ["", "w"])
def test_equations_have_a_column_of_weights_if_there_are_any(weight):
    one, other = Equation("a", "y", "y_", ()), Equation("b", "z", "z_", (), weight)
    weights = [("weight",)] * bool(weight)
    table = pieces_table([one, other], "Model")
    assert table.headings == (*("piece", *("weight",) * bool(weight)), "equation")
    assert table.rows[1] == (("b", "w", "z") if weight else ("b", "z"))
    assert table.rows[0][-1] == "y"
    table = equations_table([one, other], {"mm": [other, one]})
    assert len(table.headings) == 5 + len(weights)
    assert table.rows[0][0] == "a"
    assert table.rows[0][-4:] == ("y", "z", "y_", "z_")


def test_violations_of_a_shape_are_shares_of_the_range():
    asked = SimpleNamespace(quantity="strain", word="falling")
    violation = SimpleNamespace(asked=asked, amount=0.2, share=0.05, place="")
    kept = SimpleNamespace(
        quantity="strain", word="falling", violated=0.7, binds={"strain": (0.1, 0.25)}
    )
    shape = SimpleNamespace(
        kept=[kept], training=1.0, training_without=2.0, held_out=3.0, held_out_without=4.0
    )
    output = Quantity("force", "N")
    inputs = SimpleNamespace(
        model=SimpleNamespace(output=output, shape=shape), violations=[violation]
    )
    table = shape_table(inputs)
    assert table.rows == (
        ("strain", "falling", 0.2, pytest.approx(5), None, 0.7, "strain 0.1 to 0.25"),
    )
    assert "training 1 | 2 N, held out 3 | 4 N" in table.notes[1]
    assert table.notes[0].startswith("Known from the spec. ")
    inputs.model.shape = None
    table = shape_table(inputs)
    assert table.rows[0][-2:] == (None, None)
    (note,) = table.notes
    assert note.startswith("Known from the kind of muscle. ")


def test_structures_are_in_the_order_of_their_errors_with_failures_last():
    tried = (
        Tried("map", "long", {}, 9, (0.3,), 0.3, 0.4, excess=0.2, spread=0.1, seconds=2.0),
        Tried("map", "none", {}, failure="too few", excess=0.0),
        Tried("map", "short", {}, 3, (0.2,), 0.2, math.nan, excess=0.0, spread=0.0),
        Tried("black box", "process", {}, 0, (0.1,), 0.1, excess=-0.5),
    )
    search = Search("s", "y", "levels", "inner levels", 12.0, tried, 2, 2, "the best", notes=("n",))
    table = search_table(search)
    assert [(row[0], row[-1]) for row in table.rows] == [
        *(("process", "to compare with"), ("short", "best, chosen"), ("long", "")),
        ("none", "failed: too few"),
    ]
    assert table.rows[2][1:-1] == (*map(pytest.approx, (30, 40, 20, 10)), 9, 2)
    assert [row[5] for row in table.rows] == [None, 3, 9, None]
    assert "= 12." in table.notes[0]
    assert table.notes[1:] == (
        "Levels left out: the same for inner levels.",
        "Chosen: the best. Held-out data were not used.",
        "n",
    )
    assert len(search_table(replace(search, parts="")).notes) == 3


@pytest.mark.parametrize("ordered", [False, True])
def test_states_have_their_frequencies_ranges_and_scales(ordered):
    states = SimpleNamespace(
        resonances={"r": (2.0, 0.1)}, ranges={"p": (0.0, 5.0)}, step=0.025, ordered=ordered,
        scaled=True, names=("s",), low=np.array([-1.0]), high=np.array([3.0]), margin=0.2,
    )  # fmt: skip
    table = states_table(states)
    assert [(row[0], *row[2:]) for row in table.rows] == [
        ("r", None, None, 2, 0.1),
        ("p", 0, 5, None, None),
        ("s", -1, 3, None, None),
    ]
    assert table.notes[0].startswith("Samples are 0.025 s apart" + " in the median" * ordered)
    assert "plus 0.2 of it at each end" in table.notes[1]
    states.scaled = False
    assert (len(states_table(states).rows), len(states_table(states).notes)) == (2, 1)


def test_numbers_of_operators_say_which_are_at_a_bound():
    numbers = SimpleNamespace(
        names=("a", "b"), numbers=np.array([1.5, 2.0]), errors=np.array([0.1, 0.2]),
        held=np.array([True, False]),
    )  # fmt: skip
    fit = SimpleNamespace(identified=numbers, selection=SimpleNamespace(errors_note="a note"))
    table = identified_table(fit)
    assert table.rows == (("a", 1.5, 0.1, "yes"), ("b", 2.0, 0.2, "no"))
    assert table.notes[0].endswith("a note")
    fit.identified = None
    assert identified_table(fit).rows == ()


def test_later_models_are_compared_with_the_first():
    results = [SimpleNamespace(ratio=k, interval=(k - 1, k + 1), answer=f"{k}") for k in (2, 5)]
    table = drift_table(["a", "b", "c"], results)
    assert table.rows == (("b", 2, 1, 3, "2"), ("c", 5, 4, 6, "5"))
    assert table.title == "Every model against a"


def score(model, rmse):
    return Score(model, "y", "validate", "all", 9, rmse, rmse, 1.0, "range", rmse, rmse, 0.5)


def test_changes_of_curves_and_of_all():
    change = SimpleNamespace(
        curve="p=1", ratio=1.1, weight=0.25, difference=2.0, rms=3.0, largest=-4.0,
        place={"strain": 0.12345, "u": 2.0},
    )  # fmt: skip
    comparison = SimpleNamespace(
        unit="N", by_effect=[change], curves=[1, 2, 3], ratio=1.05, interval=(1.0, 1.1), p=0.04,
        p_permutation=None, before="old", after="new",
    )  # fmt: skip
    table = changes_table(comparison)
    assert table.rows == (
        ("p=1", 1.1, 25, 2, 3, -4, "strain 0.1235, u 2"),
        ("all", 1.05, 100, None, None, None, None),
    )
    assert table.title == "new against old"
    assert "(Student's t, 2 degrees of freedom; the unit is the curve), p = 0.04." in table.notes[0]
    comparison.unit = "%"  # differences of a target in per cent are no fractions
    assert changes_table(comparison).rows == table.rows
    assert "largest difference [%]" in changes_table(comparison).headings
    comparison.p_permutation = 0.25
    assert "permutation of the curves' signs p = 0.25." in changes_table(comparison).notes[0]


def test_a_column_of_scores_is_shown_if_any_row_has_it():
    rows = [score("a", 1.0), replace(score("b", 2.0), chi2_dof=0.5)]
    table = score_table(rows, {"y": "N"})
    assert "RMSE [N]" in table.headings
    assert {len(row) for row in table.rows} == {len(table.headings)}
    # the errors of a target in per cent are no fractions
    assert score_table(rows, {"y": "%"}).rows == table.rows
    assert len(table.headings) > len(score_table(rows[:1], {"y": "N"}).headings)


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (replace(score("b", 0.02), nrmse_range=0.5), "lies far from zero"),
        (score(REPEATABILITY, 0.1), "not a model, but the difference between repeated"),
        (replace(score("b", 0.02), rrse=0.2, rrse_one_step=0.1), "those of the free run"),
    ],
)
def test_a_note_explains_what_any_row_of_scores_has(other, words):
    ordinary = score("a", 1.0)
    assert words not in " ".join(score_table([ordinary], {"y": "N"}).notes)
    assert words in " ".join(score_table([ordinary, other], {"y": "N"}).notes)


def test_limits_of_a_model_that_contains_others_are_those_of_each():
    def model(name):
        curve = SimpleNamespace(curve="c", level=None, limits={"x": (0.0, 2.0)})
        body = SimpleNamespace(ranges=[curve])
        return SimpleNamespace(name=name, level=None, inputs=[Quantity("x", "mm")], body=body)

    whole, part = model("whole"), model("part")
    whole.each, whole.every = [whole], [whole, part]
    made = [(table.name, table.title.partition(" (")[2]) for table in limits_tables(whole)]
    assert made == [("limits", ""), ("limits_1", "part)")]
    whole.each = [part, model("other")]  # two outputs have the same ranges
    assert [table.rows for table in limits_tables(whole)] == [(("c", 0, 2),)]


def test_the_section_of_a_kind_of_model_stands_before_the_folded_sections(monkeypatch):
    class Kind:
        def section(self):
            return sections.PageSection("own", "Own")

    monkeypatch.setattr(sections, "shown_by", {"fit": Kind()}.get)
    found = sections.sections_of(SimpleNamespace(fits={"a": "fit", "b": "fit", "c": None}))
    folded = [section.folded for section in found if section.id != "own"]
    place = [section.id for section in found].index("own")
    assert (len(found), folded.index(True)) == (len(sections.SECTIONS) + 1, place)


@pytest.mark.parametrize("timed", [False, True])
def test_levels_are_compared_with_a_single_valued_curve_unless_drawn_over_time(timed, monkeypatch):
    monkeypatch.setattr(sections.tables, "levels_table", lambda _data, along, _whole: along)
    monkeypatch.setattr(sections.tables, "recordings_table", lambda _whole: "recordings")
    strain = Quantity("strain", "1")
    inputs = SimpleNamespace(timed=timed, in_curve=strain, dataset=None, whole=None)
    assert [*sections._of_data(inputs)] == [None if timed else "strain", "recordings"]


@pytest.mark.parametrize(("count", "more"), [(4, False), (5, True)])
def test_a_summary_has_four_equations_at_most(count, more, monkeypatch):
    every = [Equation(f"s{number}", "y", "y_") for number in range(count)]
    monkeypatch.setattr(summary, "equations", lambda _model: every)
    lines = [*summary._in_physical_units(None)]
    assert (len(lines), f"has {count} equations" in lines[-1]) == (4 + more, more)
