"""What speaks against a number: one list, the worst first."""

import ast
import inspect
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import search_tables
from report_builder import build, surface

from mapmore_cli.annexes.search import stage
from mapmore_cli.domain.results import AUTOCORRELATION, ResidualTest, Search, Tried
from mapmore_cli.domain.scores import STRUCTURE_SEEN
from mapmore_cli.modelling.validation.residuals import residual_tests
from mapmore_cli.reporting import alerts
from mapmore_cli.reporting.alerts import ALERTS, FEW_CURVES, unconfirmed_sentence
from mapmore_cli.reporting.report import render_page
from mapmore_cli.reporting.sections import SECTIONS
from mapmore_cli.reporting.table import CODE


def test_every_kind_is_ranked_and_raised_and_has_a_section():
    """A kind is the first of the two or three values of an alert, which the module makes."""
    firsts = (
        node.elts[0]
        for node in ast.walk(ast.parse(inspect.getsource(alerts)))
        if isinstance(node, ast.Tuple) and len(node.elts) in (2, 3)
    )
    values = (
        part for one in firsts for part in (getattr(one, "body", one), getattr(one, "orelse", one))
    )
    raised = {value.value for value in values if isinstance(value, ast.Constant)}
    assert raised == {*ALERTS}
    assert {*ALERTS.values()} <= {section.id for section in SECTIONS} | {"unconfirmed"}


def test_guesses_are_counted_in_plain_words():
    assert unconfirmed_sentence(1).startswith("1 guess of the spec is not confirmed")
    assert unconfirmed_sentence(2).startswith("2 guesses of the spec are not confirmed")


@pytest.fixture(scope="module")
def inputs():
    return build()


def kinds(inputs):
    return [alert.kind for alert in inputs.alerts]


def with_tests(inputs, **values):
    tests = tuple(
        ResidualTest(name, np.arange(21.0), np.full(21, value), np.ones(21))
        for name, value in values.items()
    )
    return replace(inputs, validation=replace(inputs.validation, residual_tests=tests))


def test_residuals_that_fail_are_alerts_and_those_that_pass_are_none(inputs):
    noisy = with_tests(inputs, **{AUTOCORRELATION: 2.0, "strain": 0.5})
    assert {"residuals", "mean error"} & {*kinds(noisy)} == {"residuals"}
    noisy = with_tests(inputs, **{AUTOCORRELATION: 0.5, "strain": 2.0})
    (alert,) = (one for one in noisy.alerts if one.kind == "mean error")
    assert "strain: 21 of 21" in alert.sentence


def test_the_worst_is_first_and_nothing_is_said_twice(inputs):
    chosen = f"{STRUCTURE_SEEN}levels"
    worst = replace(inputs, validation=replace(inputs.validation, warnings=("odd", chosen, "odd")))
    worst = replace(worst, doubts=("a doubt",), unconfirmed=("is it N?", "is it kPa?"))
    found = kinds(worst)
    assert found == sorted(found, key=[*ALERTS].index)
    assert found[:3] == ["structure", "unconfirmed", "warning"]
    assert found.count("warning") == 1
    assert worst.alerts[0].sentence == chosen


@pytest.mark.parametrize(
    ("held_out", "words"),
    [
        ((), ["nothing is held out"]),
        ((150,), ["only 1 curve has he"]),
        ((150, 250), ["only 2 curves have "]),
        ((150, 250, 350), []),
    ],
)
def test_few_curves_are_an_alert(held_out, words):
    def mask(level, strain):
        return np.full(len(strain), level in held_out)

    alerts = build((80, 150, 250, 350), mask).alerts
    assert [one.sentence[:19] for one in alerts if one.kind == "few curves"] == words


def test_what_is_left_out_in_turn_is_held_out():
    inputs = build((80, 150, 250), lambda _level, strain: np.zeros(len(strain), bool))
    rows = tuple(replace(row, split="validate") for row in inputs.validation.scores)
    assert "few curves" in kinds(inputs)
    scored = replace(inputs, validation=replace(inputs.validation, scores=rows))
    assert "few curves" not in kinds(scored)


def test_held_out_samples_beyond_the_training_range_are_counted():
    def top(level, strain):
        return np.full(len(strain), level == 350)

    (alert,) = (one for one in build(held_out=top).alerts if one.kind == "extrapolated")
    assert alert.sentence == "100 % of the held-out samples lie beyond the training range"


def curve_rows(inputs, model, factors):
    """Scores of as many held-out curves as there are factors, of a model that errs so much more."""
    row = next(one for one in inputs.validation.scores if one.curve == "all")
    row = replace(row, split="validate")
    every = []
    for name, errors in (("mapmore", np.ones(len(factors))), (model, np.array(factors))):
        every += [replace(row, model=name, rmse=float(np.sqrt(np.mean(errors**2))))]
        every += [
            replace(row, model=name, curve=f"c{place}", rmse=float(error))
            for place, error in enumerate(errors)
        ]
    return replace(inputs, validation=replace(inputs.validation, scores=tuple(every)))


@pytest.mark.parametrize(
    ("factors", "kind"),
    [
        ([0.5, 0.6, 0.7], "competitor"),
        ([0.76, 1.26, 1.76], "near"),  # more by 0.26, whose standard error is 0.5/sqrt(3)
        ([0.8, 1.3, 1.8], None),
        ([0.995] * FEW_CURVES, "near"),  # as the verdict, which sees no difference to speak of
        ([1.0] * FEW_CURVES, "near"),
        ([0.995], None),
        ([1.01] * (FEW_CURVES - 1), None),
    ],
)
def test_competitors_that_err_less_or_as_much_are_alerts(inputs, factors, kind):
    found = {*kinds(curve_rows(inputs, "sarosi", factors))} & {"competitor", "near"}
    assert found == ({kind} if kind else set())


def test_better_competitors_are_named_with_both_errors_the_best_first(inputs):
    row = next(one for one in inputs.validation.scores if one.curve == "all")
    errors = {"mapmore": 2.0, "arx": 1.5, "mlp": 1.6, "sarosi": 1.0, "cubic": 1.99}
    scores = tuple(replace(row, model=name, rmse=error) for name, error in errors.items())
    found = replace(inputs, validation=replace(inputs.validation, scores=scores)).alerts
    assert [one.sentence for one in found if one.kind == "competitor"] == [
        "Sárosi has a smaller error: RMSE 1 against 2 N",
        "ARX has a smaller error: RMSE 1.5 against 2 N",
        "Neural network, a black box that gives no equations, has a smaller error: RMSE 1.6 "
        "against 2 N; other inputs, further terms, longer structures or more training data may "
        "reduce the error of mapmore",
    ]


def test_a_page_says_so_if_a_black_box_or_a_simple_model_errs_less(monkeypatch):
    """Competitors that only the measurement names are not on the page of a study without them."""
    report = build(competitors={"quadratic": lambda p, _: p, "mlp": lambda p, e: surface(p, e)})
    search = Search("search", "force", "", "", 1.0, (Tried("surface", "one", {}),), 0, 0)

    def said_of(search, scores=report.validation.scores):
        files = SimpleNamespace(
            search=lambda: search,
            dataset=lambda: report.dataset,
            model=lambda: report.model,
            validation=lambda: replace(report.validation, scores=tuple(scores)),
        )
        alerts = search_tables.alerts_without_rivals(files)
        return search_tables.says_so(alerts), {"competitor", "black box", "search"} & {*alerts}

    notes = ("a remark", "boosting errs less")
    assert said_of(search) == ("no", set())
    assert said_of(replace(search, notes=notes)) == ("no", {"search"})
    outdone = replace(search, notes=notes, outdone=notes[1])
    assert said_of(outdone) == ("yes", {"search", "black box"})
    better = (
        replace(row, rmse=1e-9) for row in report.validation.scores if row.model == "quadratic"
    )
    kept = (row for row in report.validation.scores if row.model != "quadratic")
    assert said_of(search, (*kept, *better)) == ("yes", {"competitor"})
    boxed = replace(search, tried=(*search.tried, Tried("black box", "mlp", {})))
    monkeypatch.setattr(stage, "find_spec", lambda _name: True)
    assert said_of(boxed) == ("yes", {"competitor"})


def test_every_alert_is_on_the_page_with_a_link_to_a_section(inputs):
    worst = replace(with_tests(inputs, **{AUTOCORRELATION: 2.0}), unconfirmed=("N?",))
    page = render_page(worst, {})
    for alert in worst.alerts:
        words = CODE.sub(r"<code>\1</code>", alert.sentence)
        assert f'<a href="#{alert.section}">{words}' in page.replace("&#39;", "'")
        assert f'id="{alert.section}"' in page


def test_errors_are_compared_with_the_inputs_of_the_model_and_no_other_column(inputs):
    """A displacement from which the strain is derived is measured, but the model has the strain."""
    curves = tuple(
        replace(curve, columns=curve.columns | {"displacement": 0.069 * curve.columns["strain"]})
        for curve in inputs.dataset.curves
    )
    dataset, predicted = replace(inputs.dataset, curves=curves), inputs.validation.predictions
    tests = residual_tests(inputs.model, dataset, predicted[inputs.own], "strain")
    assert {test.name for test in tests} == {AUTOCORRELATION, "strain"}  # one pressure is held out
