"""The page of all runs: one row for each output, kept in the page itself."""

import json
import re
import shutil
import time
from dataclasses import replace
from html.parser import HTMLParser
from threading import Thread
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of

from mapmore_cli.domain.errors import SpecError, WriteError
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.scores import Alert, Score, ScoreTable
from mapmore_cli.modelling import kinds
from mapmore_cli.pipeline import runs_page
from mapmore_cli.pipeline.report import _in_units, faults_of
from mapmore_cli.pipeline.runs_page import write_runs_page
from mapmore_cli.pipeline.runs_rows import MARK, RunRow, known_alerts, mark_of, rows_of
from mapmore_cli.reporting.inputs import FigureStyle

HOSTILE = "</script><script>alert(1)</script>\"'&"


class Folder:
    """A folder of runs whose results are not read from files."""

    def __init__(self, path, monkeypatch):
        self.runs, self.page = path, path / "index.html"
        curve = SimpleNamespace(
            columns={"strain": np.arange(9.0), "force": np.arange(9.0) ** 2},
            held_out=np.ones(9, bool),
            size=9,
        )
        dataset = SimpleNamespace(curves=(curve,), target="force")
        validation = SimpleNamespace(
            shown=None, predictions={"mapmore": (np.arange(9.0),)}, along="strain"
        )
        files = SimpleNamespace(
            validation=lambda: SimpleNamespace(each=(validation,)),
            dataset=lambda: SimpleNamespace(each=(dataset,)),
        )
        monkeypatch.setattr(runs_page, "RunFiles", lambda _folder: files)

    def finish(self, name, muscle="Peano", nrmse=0.01, alerts=()):
        """A run that came to its end."""
        folder = self.runs / name
        folder.mkdir(exist_ok=True)
        slices = {
            "ingest": {"slice": {"data": {"files": ["a.csv", "b.csv"]}}, "seconds": 0.25},
            "report": {"slice": {"muscle": {"name": muscle}}, "seconds": 1.5},
        }
        (folder / "run.json").write_text(json.dumps({"stages": slices}))
        (folder / "scores.json").write_text("{}")
        scores = [
            Score(model, "force", "validate", "all", 9, 1.0, error, 100.0, "max", 1.0, 0.01, 0.9, 0)
            for model, error in (("mapmore", nrmse), ("sarosi", 0.02))
        ]
        table = ScoreTable(tuple(scores), {"force": "N"})
        return SimpleNamespace(name=name, run_dir=folder, table=table, alerts=alerts)

    @property
    def rows(self):
        return rows_of(self.page)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    return Folder(tmp_path, monkeypatch)


def test_a_run_that_ends_gets_a_row_and_replaces_its_own(folder):
    alert = Alert("few curves", "only 1 curve", "fit")
    write_runs_page(folder.runs, [folder.finish("a", alerts=(alert,)), folder.finish("b")])
    row = next(row for row in folder.rows if row.run == "a")
    assert (row.muscle, row.data, row.target) == ("Peano", "a.csv and 1 more", "force")
    assert (row.own, row.best_other, row.alerts) == (1.0, ("sarosi", 2.0), (alert,))
    assert [line.count("l") for line in row.picture] == [8, 8]
    assert row.seconds == {"ingest": 0.25, "report": 1.5}
    assert 'data-sort="1.75"' in folder.page.read_text()
    time.sleep(0.02)
    write_runs_page(folder.runs, [folder.finish("a", nrmse=0.005)])
    assert {row.run: row.own for row in folder.rows} == {"a": 0.5, "b": 1.0}
    assert folder.rows[0].run == "a"  # the latest first


def test_a_run_of_one_score_and_one_recording(folder):
    run = folder.finish(
        "a", nrmse=np.nan, alerts=[Alert("x", "x", "fit", target) for target in "zy"]
    )
    run.table = ScoreTable((replace(run.table.scores[0], target="y"),), {"y": "N"})
    record = json.loads((run.run_dir / "run.json").read_text())
    record["stages"]["ingest"]["slice"]["data"]["files"] = ["a.csv"]
    record["origin"] = {"campaign": "c.yaml"}
    (run.run_dir / "run.json").write_text(json.dumps(record))
    write_runs_page(folder.runs, [run])
    (row,) = folder.rows
    assert (row.data, row.campaign, row.target, row.split) == ("a.csv", "c.yaml", "y", "validate")
    assert (row.own, row.best_other, [alert.target for alert in row.alerts]) == (None, None, ["y"])


def test_runs_that_are_gone_have_no_row(folder):
    write_runs_page(folder.runs, [folder.finish("a"), folder.finish("b")])
    shutil.rmtree(folder.runs / "a")
    write_runs_page(folder.runs, [])
    assert [row.run for row in folder.rows] == ["b"]


@pytest.mark.parametrize("text", ["<h1>My thesis</h1>", f"{MARK}no rows</script>", ""])
def test_a_page_of_the_user_stays(folder, text):
    folder.page.write_text(text)
    warnings = []
    write_runs_page(folder.runs, [folder.finish("a")], warnings.append)
    assert folder.page.read_text() == text
    assert "stays as it is" in warnings[0]


def test_nothing_is_written_through_a_link(folder, tmp_path):
    away = tmp_path / "away.html"
    folder.page.symlink_to(away)
    with pytest.raises(WriteError, match="is a link"):
        write_runs_page(folder.runs, [folder.finish("a")])
    assert not away.exists()


def test_names_are_words_and_no_markup(folder):
    write_runs_page(folder.runs, [folder.finish("a", muscle=HOSTILE)])
    (row,) = folder.rows
    assert row.muscle == HOSTILE
    scripts = []
    parser = HTMLParser()
    parser.handle_starttag = lambda tag, attrs: scripts.append(attrs) if tag == "script" else None
    parser.feed(folder.page.read_text())
    assert scripts == [[("type", "application/json"), ("id", "runs")], []]


def test_runs_that_end_at_once_are_all_kept(folder):
    every = [folder.finish(f"r{number}") for number in range(8)]
    threads = [Thread(target=write_runs_page, args=(folder.runs, [one])) for one in every]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {row.run for row in folder.rows} == {one.name for one in every}


def test_two_thousand_runs_take_less_than_a_second(folder):
    write_runs_page(folder.runs, [folder.finish("a")])
    (row,) = folder.rows
    rows = [replace(row, run=f"r{number}") for number in range(2000)]
    for one in rows:
        (folder.runs / one.run).mkdir()
    folder.page.write_text(runs_page._page(folder.runs, rows))
    start = time.process_time()
    write_runs_page(folder.runs, [folder.finish("a", nrmse=0.002)])
    assert time.process_time() - start < 1.0
    assert len(folder.rows) == 2001


def test_a_row_without_scores_says_nothing(folder):
    row = RunRow("a", "", "", "", "force", "", {}, (), 0.0, ("", ""))
    page = runs_page._page(folder.runs, [row])
    assert (row.own, row.best_other, row.day) == (None, None, "1970-01-01 00:00")
    assert "<svg" not in page


def places(path):
    """The points of a path of relative steps."""
    numbers = [float(each) for each in re.findall(r"-?\d*\.?\d+", path)]
    return np.cumsum(np.reshape(numbers, (-1, 2)), axis=0)


def test_a_picture_of_the_first_held_out_curve():
    """The sheet has a rim of one; the curve goes from its left to its right, by x or by time."""
    x, y, predicted = np.array([[3.0, 1, 2, 5, 4], [0, -10, 10, 30, 20], [5, np.nan, 10, 25, -5]])
    columns = {"x": x, "force": y}
    training = curve_of({name: np.zeros(5) for name in columns})
    for more, order in (({}, np.argsort(x)), ({"time": 0 * x}, range(5))):
        held_out = curve_of(columns | more, np.arange(5) == 2)
        dataset = SimpleNamespace(target="force", curves=(training, held_out, training))
        said = {"mapmore": (np.zeros(5), predicted, np.zeros(5))}
        for shown in (None, SimpleNamespace(curves=dataset.curves)):
            validation = SimpleNamespace(shown=shown, predictions=said, along="x")
            pictures = runs_page._picture(validation, dataset)
            for picture, values in zip(pictures, (y, predicted), strict=True):
                heights = 35 - 34 * (values[order] + 10) / 40
                expected = np.column_stack([[1, 30.5, 60, 89.5, 119], heights])
                np.testing.assert_allclose(
                    places(picture), expected[np.isfinite(heights)], atol=0.06
                )
        dataset.target = "other"
        assert runs_page._picture(validation, dataset) == ("", "")


def test_a_long_curve_is_drawn_by_forty_of_its_samples():
    curve = curve_of({"force": np.arange(1000.0)})
    dataset = SimpleNamespace(target="force", curves=(curve,))
    validation = SimpleNamespace(
        shown=None, predictions={"mapmore": (np.full(1000, 7.0),)}, along="x"
    )
    measured, level = map(places, runs_page._picture(validation, dataset))
    assert (len(measured), len(level)) == (40, 40)
    np.testing.assert_allclose(measured[[0, -1]], [[1, 35], [119, 1]])


QUESTION = Alert("unconfirmed", "1 guess is not confirmed", "unconfirmed")
ROW = RunRow("a", "Peano", "", "a.csv", "force", "validate", {}, (), 0.0, ("", ""))


@pytest.mark.parametrize(
    ("errors", "own", "best"),
    [
        ({"mapmore": 2.0}, 2.0, None),
        ({"sarosi": 3.0, "mapmore": 2.0, "cubic": 2.5, "plane": 9.0}, 2.0, ("cubic", 2.5)),
    ],
)
def test_the_best_of_the_others_is_that_of_the_smallest_error(errors, own, best):
    row = replace(ROW, nrmse=errors, ended=86400 + 3600 + 59)
    assert (row.own, row.best_other, row.day) == (own, best, "1970-01-02 01:00")


def test_alerts_are_known_while_the_run_is_that_of_the_page(folder):
    run = folder.finish("a", alerts=(Alert("x", "first", "fit"), Alert("y", "second", "fit")))
    assert known_alerts(run.run_dir) is None  # there is no page
    write_runs_page(folder.runs, [run, folder.finish("b")])
    assert known_alerts(run.run_dir) == run.alerts
    assert known_alerts(folder.runs / "b") == ()
    assert known_alerts(folder.runs / "c") is None
    for name in ("run.json", "check.json"):  # another run has ended since
        (run.run_dir / name).write_text(f"other {name}")
        assert known_alerts(run.run_dir) is None
        write_runs_page(folder.runs, [folder.finish("a", alerts=run.alerts)])
        assert known_alerts(run.run_dir) == run.alerts


def test_the_mark_of_a_run_does_not_depend_on_when_and_why_it_ran(folder):
    run_dir = folder.finish("a").run_dir
    record = json.loads((run_dir / "run.json").read_text())

    def mark(seconds, why, **output):
        record["stages"]["report"] |= {"seconds": seconds, "why": why, "outputs": {"x": output}}
        (run_dir / "run.json").write_text(json.dumps(record))
        return mark_of(run_dir)

    first = mark(1.0, "first time", sha256="aa", mtime_ns=1, ctime_ns=1, inode=1)
    assert mark(2.0, "forced", sha256="aa", mtime_ns=2, ctime_ns=2, inode=2) == first
    assert mark(1.0, "first time", sha256="bb", mtime_ns=1, ctime_ns=1, inode=1) != first


def test_a_row_is_made_again_when_only_the_page_of_its_run_has_changed(folder):
    """The time of the scores is the same."""
    for muscle, alerts in (("A", ()), ("B", ()), ("B", (QUESTION,)), ("B", ())):
        write_runs_page(folder.runs, [folder.finish("a", muscle, alerts=alerts)])
        assert [(row.muscle, row.alerts) for row in folder.rows] == [(muscle, alerts)]
        assert known_alerts(folder.runs / "a") == (None if alerts else ())


def test_equations_in_other_units_are_named_by_what_differs(monkeypatch):
    asked = []
    monkeypatch.setattr(kinds, "equations", lambda _, factors: asked.append(factors) or ("e",))
    names = {"pressure": "kPa", "pressure_rate": "kPa/s", "strain": "1"}
    inputs = tuple(Quantity(name, unit) for name, unit in names.items())
    rate = SimpleNamespace(name="pressure_rate", of="pressure", kind="rate")
    model = SimpleNamespace(signals=(rate,), inputs=inputs)
    assert _in_units(model, {}) == _in_units(model, {"pressure": "kPa"}) == {}
    assert _in_units(model, {"pressure": "bar"}) == {
        "pressure in bar, pressure_rate in bar/s": ("e",)
    }
    assert _in_units(model, {"strain": "%"}) == {"strain in %": ("e",)}
    for found, wanted in zip(
        asked, ({"pressure": 100, "pressure_rate": 100}, {"strain": 0.01}), strict=True
    ):
        assert found == pytest.approx(wanted, rel=1e-12)


def test_fonts_and_formulas_of_figures_are_looked_at():
    style = FigureStyle()
    assert faults_of(style) == []
    assert faults_of(replace(style, font="DejaVu Sans", labels={"force": "$F$ (N)"})) == []
    (warning,) = faults_of(replace(style, font="No Such Font"))
    assert "'No Such Font' is not installed here" in warning
    with pytest.raises(SpecError, match=r"report.style.labels.force: '\$\\\\nothing\$' cannot be"):
        faults_of(replace(style, labels={"force": r"$\nothing$"}))
