"""What a campaign says over all its runs, in tables and in its figure."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure
from report_builder import Page, score

from mapmore_cli.annexes.campaigns import page
from mapmore_cli.annexes.campaigns.figure import (
    BEST_OTHER,
    MOST_RUNS,
    campaign_figures,
)
from mapmore_cli.annexes.campaigns.page import render_campaign, scores_of, write_page
from mapmore_cli.annexes.campaigns.tables import (
    CampaignScores,
    campaign_tables,
    models_table,
    nrmse_table,
    published_table,
)
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.scores import REPEATABILITY, Published, ScoreTable


def row(model, rmse, split="validate"):
    return score(model, rmse / 100, split)


def runs_of(text):
    """Runs by name, as `a mapmore 1 sarosi 2; b mapmore 3`: RMSE of each model."""
    found = {}
    for name, *words in map(str.split, text.split(";")):
        models = zip(words[::2], map(float, words[1::2]), strict=True)
        found[name] = [row(*model) for model in models]
    return found


def test_a_failed_run_is_told_by_its_name():
    table = nrmse_table(CampaignScores(runs_of("a mapmore 1 sarosi 2"), failed=("broken",)))
    assert table.rows[1] == ("broken", "failed", None)
    assert table.numeric[1]
    assert nrmse_table(CampaignScores({}, failed=("broken",))).notes == ()


def test_hostile_names_are_text_on_the_page():
    hostile = "<script>alert(1)</script>\"'&<img src=x onerror=y>"
    scores = CampaignScores(
        {hostile: [row("mapmore", 1), row(hostile, 2)]}, failed=(hostile + "2",)
    )
    page = Page(
        render_campaign(
            SimpleNamespace(title="", campaign=hostile),
            campaign_tables(scores),
            [],
            {hostile: "../x/report/index.html"},
            {hostile: hostile},
        )
    )
    assert not {"img", "iframe"} & {tag for tag, _ in page.tags}
    assert page.named("script") == [{}]  # that of every page
    assert not any(hostile in one for one in page.scripts)
    assert page.text.count(hostile) >= 6


def test_exact_ties_are_told():
    runs = runs_of("a mapmore 2 sarosi 2 flat 5; b mapmore 1 sarosi 2 flat 5")
    scores = CampaignScores(runs, relative_to="sarosi", best_of=("sarosi", "flat"))
    table = {row[0]: row for row in nrmse_table(scores).rows}
    assert table["runs better"][1] == "1 of 2, 1 tied"
    assert table["below the best formula"][1] == "1 of 2, 1 tied"


def test_ratios_are_of_the_runs_that_have_both():
    runs = runs_of("a mapmore 1 sarosi 2; b mapmore 12 sarosi 4; c mapmore 5")
    table = nrmse_table(CampaignScores(runs, relative_to="sarosi"))
    assert table.rows[:3] == (("a", 1.0, 2.0), ("b", 12.0, 4.0), ("c", 5.0, None))
    assert table.rows[3][1] == pytest.approx(math.sqrt(0.5 * 3))
    assert table.rows[4][1:] == (3.0, 1.0)
    assert table.rows[5][1:] == ("1 of 2", "0 of 2")


def test_groups_have_a_median_and_a_worst():
    runs = runs_of("a mapmore 1 lags 9; b mapmore 4 lags 7; c mapmore 2; d mapmore 8 lags nan")
    table = nrmse_table(
        CampaignScores(runs, groups={"a": "steps", "b": "steps", "c": "steps", "d": "loops"})
    )
    assert table.rows[4:] == (
        ("steps: median", 2.0, 8.0),
        ("steps: worst", 4.0, 9.0),
        ("loops: median", 8.0, math.inf),
        ("loops: worst", 8.0, math.inf),
    )


def test_the_note_names_what_the_errors_are_normalised_by():
    scores = CampaignScores(
        {"a": [replace(row("mapmore", 3.0), normaliser_name="range of force over validate")]}
    )
    assert nrmse_table(scores).notes == (
        "NRMSE in per cent, all curves pooled; normalised by range of force over validate.",
    )


def test_training_rows_count_where_nothing_is_held_out():
    assert nrmse_table(
        CampaignScores({"a": [replace(row("mapmore", 3.0), split="train")]})
    ).rows == (("a", 3.0),)
    assert nrmse_table(
        CampaignScores({"a": [row("mapmore", 3.0), row("mapmore", 1.0, "train")]})
    ).rows == (("a", 3.0),)


def test_repeatability_wins_nothing_and_stands_last():
    runs = runs_of("a repeatability 0.1 mapmore 1 sarosi 2; b mapmore 3 sarosi 4")
    scores = CampaignScores(runs, relative_to="sarosi", best_of=["sarosi"])
    table = nrmse_table(scores)
    assert table.headings == ("run", "mapmore", "sarosi", REPEATABILITY)
    assert [line[-1] for line in table.rows] == [0.1, None, None, None, None, None]


@pytest.mark.parametrize(
    ("runs", "below"),
    [
        ("a mapmore 1 sarosi 2 other 3; b mapmore 5 sarosi 4 other 3", "1 1 1 of 2"),
        ("a mapmore 2 sarosi nan other 3", "1 0 1 of 1"),  # nobody is best by an error without end
    ],
)
def test_a_formula_is_not_below_itself(runs, below):
    closing = nrmse_table(CampaignScores(runs_of(runs), best_of=["sarosi", "other"])).rows[-1]
    *counts, _, whole = below.split()
    assert closing == ("below the best formula", *(f"{count} of {whole}" for count in counts))


def test_published_numbers_stand_beside_ours_and_empty_columns_are_left_out():
    runs = runs_of("a mapmore 2 sarosi 4; b mapmore 3")
    table = published_table(
        CampaignScores(
            runs,
            units={"a": "N", "b": "N"},
            published={"a": Published("a paper", rmse={"mapmore": 13.7})},
        )
    )
    assert table.headings == (
        "run",
        "model",
        "RMSE [N]",
        "published RMSE [N]",
        "NRMSE [%]",
    )
    assert table.rows == (("a", "mapmore", 2.0, 13.7, 2.0),)
    assert table.notes == ("Published: a paper.",)
    both = {"mapmore": 13.7, "sarosi": 9.0}
    paper = Published("a paper", rmse=both, nrmse={"mapmore": 0.1})
    table = published_table(CampaignScores(runs, published={"a": paper}))
    assert [row[-1] for row in table.rows] == [10.0, None]


def test_tables_without_rows_are_left_out():
    assert [table.name for table in campaign_tables(CampaignScores(runs_of("a mapmore 1")))] == [
        "nrmse"
    ]


def test_a_run_that_diverged_is_worse_than_any_in_whatever_order():
    good, bad = "a mapmore 1 sarosi 2", "b mapmore nan sarosi 2"
    for runs in (f"{good}; {bad}", f"{bad}; {good}"):
        table = nrmse_table(CampaignScores(runs_of(runs), relative_to="sarosi"))
        assert [row[1] for row in table.rows[2:]] == [math.inf, math.inf, "1 of 2"]


def test_nothing_is_in_proportion_to_an_error_of_zero():
    scores = CampaignScores(
        runs_of("a mapmore 1 sarosi 0 repeatability 0"), relative_to="sarosi", best_of=["sarosi"]
    )
    assert nrmse_table(scores).rows[1][1] is None
    runs = runs_of("a mapmore 0 sarosi 0.5; b mapmore 0.25 sarosi 0.5")
    exact = CampaignScores(runs, relative_to="sarosi")
    assert [row[1] for row in nrmse_table(exact).rows[2:]] == [None, 0.5, "2 of 2"]
    assert [row[3] for row in models_table(exact).rows] == [None, None, None, 2]


def test_runs_with_few_models_in_common_are_listed():
    runs = runs_of(
        "a mapmore 2 sarosi 4 kerscher 3 repeatability 1; b mapmore 1 narx 5; c mapmore 3 cubic 2"
    )
    scores = CampaignScores(runs, failed=("d",))
    assert scores.sparse
    (table,) = campaign_tables(scores)
    assert [row[:2] for row in table.rows] == [
        *(("a", model) for model in ("mapmore", "kerscher", "sarosi", REPEATABILITY)),
        ("b", "mapmore"),
        ("b", "narx"),
        ("c", "mapmore"),
        ("c", "cubic"),
        ("d", "mapmore"),
    ]
    assert [row[2] for row in table.rows[:-1]] == pytest.approx([2, 3, 4, 1, 1, 5, 3, 2])
    assert [row[3] for row in table.rows] == pytest.approx(
        [None, 1.5, 2.0, 0.5, None, 5.0, None, 2 / 3, None]
    )
    for fuller in ("a mapmore 2 sarosi 4; b mapmore 1", "a mapmore 2; b sarosi 4"):
        assert not CampaignScores(runs_of(fuller)).sparse


def test_scores_of_runs_have_the_groups_and_references_of_their_campaign():
    one, other = (
        ScoreTable((replace(row("mapmore", 1.0), target=name),), {name: unit})
        for name, unit in (("x", "mm"), ("y", "N"))
    )
    paper = Published("a paper", {"mapmore": 0.1})
    results = {
        "A": SimpleNamespace(name="a", table=SimpleNamespace(each=(one,)), published=paper),
        "B": SimpleNamespace(name="b", table=SimpleNamespace(each=(one, other)), published=paper),
        "C": ValueError("lost"),
    }
    scores = scores_of(results)
    assert [*scores.runs] == ["a", "b (x)", "b (y)"]
    assert scores.units == {"a": "mm", "b (x)": "mm", "b (y)": "N"}
    assert scores.published == dict.fromkeys(["a", "b (x)", "b (y)"], paper)
    assert (scores.failed, scores.groups) == (("C",), {})
    runs = [SimpleNamespace(group=group) for group in (None, "g", "h")]
    campaign = SimpleNamespace(runs=runs, relative_to="sarosi", best_of=["sarosi"])
    scores = scores_of(results, campaign)
    assert (scores.groups, scores.relative_to) == ({"b (x)": "g", "b (y)": "g"}, "sarosi")
    assert scores.best_of == ["sarosi"]


def test_a_page_is_written_again_and_also_if_no_run_has_made_a_folder(tmp_path):
    runs = [SimpleNamespace(group=None)]
    campaign = SimpleNamespace(campaign="all", title="", runs=runs, relative_to=None, best_of=())
    for _ in range(2):
        place, _ = write_page(campaign, {"a": ValueError("lost")}, tmp_path / "runs", print)
        assert "lost" in place.read_text()
    told, record = [], place.parent / "campaign.json"
    place.write_text("mine")
    write_page(campaign, {"a": ValueError("lost")}, tmp_path / "runs", told.append)
    assert ["was changed after mapmore wrote the page" in message for message in told] == [True]
    (kept,) = (tmp_path / "runs" / ".trash").rglob("index.html")
    assert kept.read_text() == "mine"
    # a record of an older version does not say which files were written
    record.write_text('{"creator": "mapmore", "campaign": "all", "runs": []}')
    place.write_text("old")
    write_page(campaign, {"a": ValueError("lost")}, tmp_path / "runs", told.append)
    assert len(told) == 1
    assert "lost" in place.read_text()


def test_a_run_with_a_mistake_in_its_spec_is_called_as_no_other(monkeypatch):
    def load(config, _overrides):
        raise SpecError(f"{config}: wrong", "mend it")

    monkeypatch.setattr(page, "load", load)
    configs = ("a.yaml", "b/a.yaml")
    entries = [SimpleNamespace(config=one, called="a", overrides=()) for one in configs]
    assert page.run_names(entries, [], {}) == ["a", "b/a.yaml"]
    assert page.run_names(entries, [], {0: "known"}) == ["known", "a"]


def drawn_lines(drawing):
    """The dots of each model: errors in per cent, and the rows of the runs."""
    ax = Figure().subplots()
    drawing.panels[0].draw(ax)
    return {
        line.get_label(): (line.get_xdata().tolist(), line.get_ydata().tolist())
        for line in ax.lines
    }, ax


def test_the_figure_of_a_campaign_has_a_row_for_each_run():
    runs = runs_of(
        "a mapmore 2 sarosi 4 other 3 repeatability 1; b mapmore 1 sarosi 5; c mapmore 0 sarosi 2"
    )
    (drawing,) = campaign_figures(CampaignScores(runs, relative_to="sarosi"))
    lines, ax = drawn_lines(drawing)
    assert {name: (pytest.approx(x), rows) for name, (x, rows) in lines.items()} == {
        "mapmore": ([2, 1], [0, 1]),
        "sarosi": ([4, 5, 2], [0, 1, 2]),
        BEST_OTHER: ([3, 5, 2], [0, 1, 2]),
        REPEATABILITY: ([1], [0]),
    }
    orders = [line.get_zorder() for line in ax.lines]
    assert orders == sorted(orders, reverse=True)  # the own model is on top
    assert ax.get_xscale() == "log"
    assert "error is rounding only: mapmore in c." in drawing.alt
    assert "runs are drawn" not in drawing.alt
    for few in ("a mapmore 2 sarosi 4", "a repeatability 1; b repeatability 2"):
        assert campaign_figures(CampaignScores(runs_of(few))) == []
    without = campaign_figures(CampaignScores(runs_of("a mapmore 2; b mapmore 3")))
    assert [*drawn_lines(without[0])[0]] == ["mapmore"]


def test_an_error_of_rounding_is_not_drawn():
    errors = {"a": 0.5e-10, "b": 1e-10, "c": 2e-10, "d": 1e-3}
    runs = {name: [replace(row("mapmore", 1), nrmse=nrmse)] for name, nrmse in errors.items()}
    (drawing,) = campaign_figures(CampaignScores(runs))
    assert "mapmore in a, b." in drawing.alt
    assert drawn_lines(drawing)[0]["mapmore"][1] == [2, 3]


def test_rows_of_the_figure_have_room_for_their_dots():
    def figure_of(count):
        text = "; ".join(f"r{n} mapmore 2 sarosi 3 repeatability 1" for n in range(count))
        return campaign_figures(CampaignScores(runs_of(text), relative_to="sarosi"))[0]

    few, many = map(figure_of, (2, 12))
    step = (many.grid.height - few.grid.height) / 10  # inches of a row; a point is 1/72 of an inch
    assert 0.1 < step < 0.5
    assert 0 < few.grid.height - 2 * step < 1
    ax = drawn_lines(many)[1]
    assert all(3 < line.get_markersize() < 0.8 * 72 * step for line in ax.lines)
    assert all(line.get_markeredgewidth() < 2 for line in ax.lines)
    bars = [line.get_label() for line in ax.lines if line.get_marker() == "|"]
    assert bars == [REPEATABILITY]  # which is no model
    (rows,) = ax.collections
    assert all(part[:, 0].tolist() == [0, 1] for part in rows.get_segments())
    assert rows.get_linewidth()[0] < 1
    assert rows.get_zorder() < min(line.get_zorder() for line in ax.lines)
    labelled = ax.xaxis.get_major_locator().tick_values(0.7, 7)
    assert {1, 2, 5} <= {*labelled.round(6)} <= {0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100}


def test_of_very_many_runs_some_are_drawn_and_the_best_is_among_them():
    runs = {f"r{n}": [row("mapmore", 0.5 if n == 7 else 1 + n)] for n in range(3 * MOST_RUNS)}
    (drawing,) = campaign_figures(CampaignScores(runs))
    errors, rows = drawn_lines(drawing)[0]["mapmore"]
    assert MOST_RUNS <= len(errors) <= MOST_RUNS + 1
    assert min(errors) == pytest.approx(0.5)
    assert errors[-1] == pytest.approx(3 * MOST_RUNS)
    assert rows == [*range(len(rows))]
    assert f"{len(rows)} of {3 * MOST_RUNS} runs are drawn" in drawing.alt
