from dataclasses import replace

import numpy as np
import pytest
from report_builder import of_pieces, score, tables_of
from scipy.stats import t as student

from mapmore_cli.domain.fits import FormulaFit, Optimum
from mapmore_cli.domain.models import FoldError
from mapmore_cli.domain.recording import Dataset, Quantity, Recording
from mapmore_cli.domain.results import AUTOCORRELATION, FitResult, ResidualTest, Validation
from mapmore_cli.domain.scores import Published, ScoreTable
from mapmore_cli.reporting.fit_tables import (
    SAME,
    folds_table,
    formulas_table,
    rival_minima,
    same_models,
)
from mapmore_cli.reporting.score_tables import (
    pieces_sentence,
    score_table,
    short_verdict,
    verdict_sentence,
)
from mapmore_cli.reporting.tables import levels_table, limits_tables, recordings_table


def column(table, heading):
    j = table.headings.index(heading)
    return [row[j] for row in table.rows]


class TestScores:
    def test_pooled_rows_held_out_first_in_per_cent(self, inputs):
        table = score_table(inputs.validation.scores, {"force": "N"})
        assert column(table, "data") == ["validate"] * 3 + ["train"] * 3
        assert column(table, "model") == ["mapmore", "sarosi", "polynomial_2"] * 2
        pooled = sorted(
            (s for s in inputs.validation.scores if s.curve == "all"),
            key=lambda s: s.split,
            reverse=True,
        )
        assert column(table, "NRMSE [%]") == [100 * s.nrmse for s in pooled]
        assert column(table, "RMSE [N]") == [s.rmse for s in pooled]
        assert column(table, "max error [% FS]") == [100 * s.max_abs_error_fs for s in pooled]

    def test_published_numbers_stand_beside_the_validation_rows_only(self, inputs):
        table = tables_of(inputs)["scores"]
        assert column(table, "published NRMSE [%]") == [
            pytest.approx(2.2),
            pytest.approx(2.5),
            pytest.approx(7.0),
            None,
            None,
            None,
        ]
        assert any("M2, section 5.1" in note for note in table.notes)

    def test_published_numbers_never_stand_beside_training_rows(self, alone):
        table = score_table(
            alone.validation.scores, {"force": "N"}, Published("somewhere", rmse={"mapmore": 3.0})
        )
        assert not any("published" in heading for heading in table.headings)
        assert "nothing is held out here" in table.notes[-1]

    def test_a_published_lower_bound_is_told_as_one(self, inputs):
        printed = Published("somewhere", rmse={"mapmore": 3.0}, rmse_at_least={"sarosi": 170.0})
        table = score_table(inputs.validation.scores, {"force": "N"}, printed)
        assert column(table, "published RMSE [N]") == [3.0, ">= 170", None, None, None, None]
        assert table.numeric[table.headings.index("published RMSE [N]")]

    def test_one_full_scale_is_named_once(self, inputs):
        scores = [
            replace(s, normaliser=500.0, normaliser_name="max|force| over validate")
            for s in inputs.validation.scores
        ]
        assert (
            score_table(scores, {"force": "N"}).notes[0]
            == "NRMSE: RMSE / FS, for all rows FS = max|force| over validate = 500 N."
        )

    def test_a_failed_model_has_a_row_without_numbers(self, failed):
        (row,) = (row for row in tables_of(failed)["scores"].rows if row[0] == "sarosi")
        assert row[:2] == ("sarosi", "failed")
        assert {*row[2:]} == {None}

    def test_a_target_far_from_zero_has_its_error_by_range_beside(self):
        near, far = score("mapmore", 0.02), replace(score("mapmore", 0.02), nrmse_range=0.5)
        assert "by range [%]" not in score_table([near], {"force": "N"}).headings
        table = score_table([far], {"force": "N"})
        assert column(table, "by range [%]") == [50.0]
        assert "The target lies far from zero" in table.notes[1]
        sentence = verdict_sentence([far], "mapmore", Quantity("force", "N"))
        assert ", 50 % of the range: the target lies far from zero" in sentence

    def test_no_scores_at_all(self):
        assert score_table([], {}).rows == ()


class TestData:
    def test_reasons_of_all_recordings_become_columns(self, inputs):
        table = recordings_table(inputs.dataset)
        assert column(table, "dropped: missing value") == [3, 1, 1, 1]
        assert column(table, "dropped: outside `keep`") == [20, 0, 0, 0]
        assert table.notes == ()
        for row in table.rows:
            assert row[2] == row[3] + sum(row[4:])

    def test_resampled_recordings_are_named(self):
        recording = Recording("r1", "r1.csv", {"force": np.zeros(5)}, 100, {"missing value": 2})
        table = recordings_table(
            Dataset("force", None, {"force": Quantity("force", "N")}, (recording,), ())
        )
        assert "r1" in table.notes[0]

    def test_levels_count_training_and_validation_samples(self, mixed):
        table = levels_table(mixed.dataset)
        for curve, train, validate in zip(
            mixed.dataset.curves, column(table, "train"), column(table, "validate"), strict=True
        ):
            assert validate == np.sum(curve.held_out) > 0
            assert train + validate == curve.size
        assert column(table, "level [kPa]") == [80, 150, 250, 350]

    def test_samples_at_rest_count_only_if_they_are_held_out(self, mixed):
        held = mixed.dataset.curves[0].held_out
        curve = replace(mixed.dataset.curves[0], at_rest=np.arange(len(held)) % 3 == 0)
        table = levels_table(replace(mixed.dataset, curves=(curve,)))
        assert column(table, "train") == [sum(~held[k] and k % 3 > 0 for k in range(len(held)))]
        assert column(table, "validate") == [held.sum()]

    def test_levels_say_how_far_they_are_from_single_valued(self, inputs):
        """A loop of 12 % of the largest force about a straight line errs by 6 % at least; one
        without a loop has no such column.
        """
        there = np.linspace(0, 1, 50)
        columns = {
            "strain": np.concatenate([there, there[::-1]]),
            "force": np.concatenate([94 - 50 * there, (82 - 50 * there)[::-1]]),
        }
        curve = replace(
            inputs.dataset.curves[0],
            columns=columns,
            held_out=np.zeros(100, dtype=bool),
            origin=None,
            at_rest=None,
        )
        looped = replace(inputs.dataset, curves=(curve,))
        table = levels_table(looped, "strain")
        assert column(table, "single-valued [%]") == pytest.approx([100 * 6 / 94], rel=1e-6)
        assert "best monotone curve over strain" in table.notes[0]
        plain = replace(curve, columns={**columns, "force": 94 - 50 * columns["strain"]})
        for dataset, along in ((replace(looped, curves=(plain,)), "strain"), (looped, None)):
            assert [c.name for c in levels_table(dataset, along).columns][-1] == "recordings"


class TestModel:
    def test_parameters_have_the_interval_of_student(self, inputs):
        validation = replace(inputs.validation, formulas={"sarosi": formula_fit("sarosi")})
        (row,) = formulas_table(replace(inputs, validation=validation)).rows
        reach = student.ppf(0.975, 50 - 1) * 0.1
        assert row[3:5] == ("a", 1.0)
        assert row[6:9] == pytest.approx((0.1, 1.0 - reach, 1.0 + reach))

    def test_the_formula_of_the_model_comes_before_those_of_competitors(self, inputs):
        fits = {name: formula_fit(name) for name in ("sarosi", "kothera")}
        validation = replace(inputs.validation, formulas={"kothera": fits["kothera"]})
        study = replace(inputs, fit=FitResult(fits["sarosi"]), validation=validation)
        alone = replace(study, model=of_pieces(inputs.model, curves=()))
        for each, role in ((study, "backbone"), (alone, "own model")):
            rows = formulas_table(each).rows
            assert [row[:2] for row in rows] == [("sarosi", role), ("kothera", "competitor")]

    def test_limits_are_those_of_each_curve(self, inputs):
        (table,) = limits_tables(inputs.model)
        assert table.name == "limits"
        inside = [curve.training for curve in inputs.dataset.curves]
        strains = [curve.columns["strain"][rows] for curve, rows in
                   zip(inputs.dataset.curves, inside, strict=True) if rows.any()]  # fmt: skip
        assert column(table, "strain from") == pytest.approx([x.min() for x in strains])
        assert column(table, "strain to") == pytest.approx([x.max() for x in strains])


def formula_fit(name, sse=2.0, **others):
    return FormulaFit(name, {"a": 1.0}, {"a": 0.1}, "converged", "-", 1, 1.0, sse, 50, **others)


def test_another_minimum_has_the_ratio_of_its_error():
    other = Optimum({"a": -2.5}, 4.5)
    (sentence,) = rival_minima("own", formula_fit("sarosi", rivals=(other,)))
    assert sentence == "own: another minimum, a = -2.5, has 1.5 times its training error"


def test_the_least_error_of_the_folds_is_marked():
    table = folds_table([FoldError("a", 2.0, 3), FoldError("b", 1.5, 3)], "N")
    assert table.rows == (("a", 2.0, 3, "no"), ("b", 1.5, 3, "yes"))


def test_formulas_that_are_one_model_are_named_once_each_pair():
    fit = formula_fit
    same = same_models(
        [
            ("tondu_lopez", fit("tondu_lopez")),
            ("chou_hannaford", fit("chou_hannaford", 2.0 + 1e-10)),
        ]
    )
    assert len(same) == 1
    assert "tondu_lopez and chou_hannaford are one model here" in same[0]
    assert same_models([("a", fit("a")), ("b", fit("b", 2.001))]) == ()
    for size in (1e-6, 1e6):  # the difference is relative
        for other, count in ((1 + SAME / 2, 1), (1 + 2 * SAME, 0)):
            pair = [("a", fit("a", size)), ("b", fit("b", other * size))]
            assert len(same_models(pair)) == count
    assert (
        same_models([("a", fit("a", 0.0)), ("b", fit("b", 0.0))]) == ()
    )  # nothing is left of both
    # one formula, fitted in two ways
    assert same_models([("a", fit("a")), ("a again", fit("a", 2.0))]) == ()


BEST = "the best competitor (Sárosi) reaches"
HEAD = "mapmore predicts force with an NRMSE of 2 % (RMSE 2 N) on the held-out data"
VERDICTS = """
better than the best of the others
    mapmore .02, sarosi .025, poly .07
    HEAD; BEST 2.5 %: mapmore is better (0.8 times the RMSE).
worse is said to be worse
    mapmore .02, sarosi .01
    HEAD; BEST 1 %: mapmore is worse (2 times the RMSE).
nearly equal is no victory
    mapmore .02, sarosi .020201
    HEAD; BEST 2.02 %: no difference to speak of.
training errors are called by their name
    mapmore .02 train, sarosi .04 train
    on its own training data (nothing was held out, so this says little about new data); \
BEST 4 %: mapmore is better (0.5 times the RMSE).
a good training error hides no bad validation error
    mapmore .001 train, sarosi .02 train, mapmore .02, sarosi .01
    HEAD; BEST 1 %: mapmore is worse (2 times the RMSE).
a curve by itself does not count
    mapmore .02, sarosi .01, mapmore .0001 validate p=1
    mapmore is worse (2 times the RMSE).
no competitor
    mapmore .02
    HEAD; it was compared with no other model.
a competitor that diverged
    mapmore .02, sarosi nan
    no competitor gave a prediction to compare with.
a perfect competitor
    mapmore .02, exact 0
    reaches 0 %: mapmore is worse.
repeatability is told
    mapmore .02, sarosi .04, repeatability .01
    BEST 4 %: mapmore is better (0.5 times the RMSE); repeated measurements differ by 1 %.
repeatability is no competitor
    mapmore .02, repeatability .01
    HEAD; it was compared with no other model; repeated measurements differ by 1 %.
a model that saw held-out samples is named
    mapmore .02, sarosi .04, old .01 seen
    (0.5 times the RMSE); old was trained on held-out samples, and is not compared.
models that saw held-out samples are named
    mapmore .02, old .01 seen, older .01 seen
    with no other model; old, older were trained on held-out samples, and are not compared.
no score
    nothing
    mapmore gave no prediction.
no score that is a number
    mapmore nan
    mapmore gave no prediction.
no score of its own
    sarosi .01
    mapmore gave no prediction.
""".strip().splitlines()
"""What is shown; the scores; the end of the sentence."""


def scores_of(text):
    """Scores as `model NRMSE [split [curve]]`."""
    for model, nrmse, *place in map(str.split, [] if text == "nothing" else text.split(", ")):
        yield score(model, float(nrmse), *place)


@pytest.mark.parametrize(
    ("scores", "said"),
    [*zip(map(str.strip, VERDICTS[1::3]), map(str.strip, VERDICTS[2::3]), strict=True)],
    ids=VERDICTS[::3],
)
def test_the_verdict(scores, said):
    said = said.replace("HEAD", HEAD).replace("BEST", BEST)
    sentence = verdict_sentence([*scores_of(scores)], "mapmore", Quantity("force", "N"))
    assert sentence.endswith(said)


@pytest.mark.parametrize(
    ("scores", "said"),
    [
        ("mapmore .02, sarosi .04", "pieces: 50 % less error than the backbone sarosi alone"),
        ("mapmore .03, backbone .04", "pieces: 25 % less error than the backbone sarosi alone"),
        (
            "mapmore .02, sarosi .02, cubic .01",
            "as good: `model: {type: literature, name: sarosi}`",
        ),
        ("mapmore .02, sarosi .01", "better: `model: {type: literature, name: sarosi}`"),
        ("mapmore .0197, sarosi .02", "pieces: 1.5 % less error than the backbone sarosi alone"),
        ("mapmore .0199, sarosi .02", "as good: `model: {type: literature, name: sarosi}`"),
        ("mapmore .0201, sarosi .02", "as good: `model: {type: literature, name: sarosi}`"),
        ("mapmore .0203, sarosi .02", "better: `model: {type: literature, name: sarosi}`"),
        ("mapmore .02, cubic .04", ""),
        ("mapmore nan, sarosi .04", ""),
    ],
)
def test_what_pieces_add_to_their_backbone(scores, said):
    sentence = pieces_sentence([*scores_of(scores)], "mapmore", "sarosi")
    assert sentence.endswith(said)
    assert bool(sentence) == bool(said)


def residual_test(name, outside, of):
    """A residual test with so many values outside of their bounds."""
    own = name == AUTOCORRELATION
    values = np.repeat([1.0, 0.5, 0.0], [own, outside, of - outside])
    return ResidualTest(name, np.arange(float(len(values))), values, np.full(len(values), 0.1))


def test_the_verdict_begins_with_what_residual_tests_found():
    tests = (
        residual_test(AUTOCORRELATION, 20, 25),
        residual_test("strain", 1, 10),
        residual_test("pressure", 3, 4),
    )
    scores = [*scores_of("mapmore .02, sarosi .04")]
    made = Validation({}, {}, tuple(scores), {"force": "N"}, residual_tests=tests).table
    sentence = verdict_sentence(scores, "mapmore", Quantity("force", "N"), (), made.alert)
    assert sentence.startswith(
        "Alert: the errors are not noise alone (20 of 25 lags, 3 of 4 checks of pressure are "
        "outside). mapmore predicts force"
    )
    clean = Validation({}, {}, tuple(scores), {"force": "N"}, residual_tests=tests[1:2]).table
    assert clean.alert == ""


@pytest.mark.parametrize(
    ("scores", "alert", "line"),
    [
        (
            "mapmore .02, sarosi .04",
            "",
            "better: force, held-out RMSE: mapmore 2 N (2 %), Sárosi 4",
        ),
        ("mapmore .02, sarosi .01", "lags", "alert: the errors are not noise alone; worse: force"),
        ("mapmore .02 train", "", "alone: force, training RMSE: mapmore 2 N (2 %)"),
        ("mapmore .02, sarosi .02", "", "an exact tie: force"),
        ("mapmore nan, sarosi .02", "", "no prediction"),
    ],
)
def test_the_verdict_in_short(scores, alert, line):
    alerts = {"force": alert} if alert else {}
    table = ScoreTable((*scores_of(scores),), {"force": "N"}, alerts=alerts)
    assert short_verdict(table, "mapmore").startswith(line)


def test_the_verdict_where_every_competitor_failed():
    assert verdict_sentence(
        [score("mapmore", 0.02)], "mapmore", Quantity("force", "N"), ("sarosi",)
    ).endswith("no competitor gave a prediction to compare with.")
