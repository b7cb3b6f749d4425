"""`docs/papers` and the five papers there: nothing is without a place, verdicts follow their rules,
the page needs nothing else.
"""

import csv
import json
import re

import pytest
from claims import Judge
from cli_samples import CONFIGS, edit, held_out, write_study
from common import rows_of
from compare import main
from comparison import HERE, PUBLISHED, beside
from our_numbers import Runs
from paper import REFERENCE, PaperError, Reason, load_paper

from mapmore_cli.study.loader import load

NUMBERED = {"m1": (6, 1, 6), "m2": (24, 5, 15), "p": (17, 4, 11), "w": (16, 0, 10), "h": (6, 1, 6)}
"""Equations, tables and figures that the papers number, counted in their texts."""


@pytest.mark.parametrize("name", NUMBERED)
def test_every_equation_table_and_figure_has_a_place(name):
    """The loader refuses an unlisted number and a place that is not there; here the counts are
    those of the papers.
    """
    spec = load_paper(HERE / f"{name}.yaml").spec
    assert tuple(spec.has[kind] for kind in ("equation", "table", "figure")) == NUMBERED[name]
    numbers = [one for item in spec.items for one in item.stands_for if one[0] != "text"]
    assert len(numbers) == len(set(numbers)) == sum(NUMBERED[name])
    shown = [one.published for item in spec.items for one in item.compare]
    assert all((PUBLISHED / file).is_file() for file in shown)


CLAIMED = {
    "m1": ("abstract", "IV.B", "IV.C", "V"),
    "m2": ("abstract", *(f"5.{n}" for n in range(1, 5)), *(f"6.{n}" for n in range(1, 5)), "7"),
    "p": ("abstract", "3.1", "4", "5"),
    "w": ("abstract", "IV", "V"),
    "h": ("abstract", "III.A", "III.B", "IV"),
}
"""The sections of each paper that claim something."""


@pytest.mark.parametrize("name", CLAIMED)
def test_every_section_that_claims_something_has_its_claims_with_a_verdict(name):
    """The loader refuses a claim without a rule or a reason, without a place, or of a number that
    is not there; most have a rule, and every difference is explained or called a conjecture.
    """
    spec = load_paper(HERE / f"{name}.yaml").spec
    said = {section for claim in spec.claims for section in re.split(r", | \(", claim.of)}
    assert said >= set(CLAIMED[name])
    assert sum(bool(claim.untold) for claim in spec.claims) <= len(spec.claims) / 5
    assert len({claim.says for claim in spec.claims}) == len(spec.claims)


@pytest.mark.parametrize("file", ["m1_results.csv", "m2_results.csv"])
def test_the_specs_show_the_numbers_of_the_published_tables(file):
    with (PUBLISHED / file).open(encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    for row in rows:
        spec = load(CONFIGS / file[:2] / f"{row['study']}.yaml").spec.report.published
        given = (
            {"rmse": spec.rmse, "nrmse": spec.nrmse}
            if row["relation"] == "="
            else {"rmse": spec.rmse_at_least}
        )
        scale = 0.01 if row["unit"] == "%" else 1.0
        assert given[row["quantity"]][row["model"]] == pytest.approx(scale * float(row["printed"]))


PAPER = """\
schema_version: 1
paper: X
title: A paper of <one> table
has: {equation: 1, table: 1, figure: 1}
sources:
  bench: {run: bench.yaml}
  rows: {file: bench.csv, key: [row]}
items:
  - {id: equation 1, title: Force, status: computed, place: ["bench.yaml#name: bench"]}
  - id: table 1
    title: Errors
    status: compared
    place: [bench.yaml]
    compare:
      - title: Errors
        published: table.csv
        where: {model: [mapmore, polynomial_2]}
        labels: [study, model]
        ours: {run: "{study}.yaml", rows: {model: "{model}", split: validate, curve: all}}
        numbers:
          - {name: RMSE, unit: N, printed: rmse, ours: rmse, verdict: {factor: 2}}
          - {name: NRMSE, unit: "%", printed: "100*nrmse", ours: "100*nrmse",
              verdict: {within: 0.01}}
          - {name: NRMSE, printed: nrmse, ours: nrmse, verdict: {order: [study]}}
    why:
      - {says: It is a bench, holds: ["bench[mapmore].n > 2"], rival: it is none,
          against: ["rows[a].size_m < 3"]}
  - {id: figure 1, title: Fit, status: drawn, place: [bench.yaml], figures: [{run: bench.yaml,
      figure: fit, panel: "200", models: [polynomial_2], caption: One}]}
claims:
  - {says: It is good, of: IV, place: [table 1], holds: ["bench[mapmore].r2 > 0.9", "1 ~ 1.2"]}
  - says: A row is larger
    of: V
    place: [bench.csv]
    holds: ["least rows[a|b].size_m < mean rows[*].size_m < greatest rows[a|b].size_m",
        "rows[a].size_m / 2 > 3"]
  - {says: It is easy, of: V, place: [table 1], untold: no number}
"""


@pytest.fixture
def paper(tmp_path):
    """A paper whose only table is to be written by the test."""
    write_study(tmp_path)
    (tmp_path / "x.yaml").write_text(PAPER)
    (tmp_path / "bench.csv").write_text("row,size [m]\na,2\nb,8\n")
    return tmp_path / "x.yaml"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    rows_of("""
figure: 1}                    figure: 2}                 figure 2 is not listed
place: [bench.yaml], figures  place: [], figures         place
place: [bench.yaml], figures  figures                    place
place: [bench.yaml], figures  place: [none.md], figures  there is no
name: bench                   name: else                 does not hold
status: computed              status: absent             note
status: computed              status: drawn              figures
status: computed              status: done               computed
{factor: 2}                   {factor: 2, within: 1}     one rule
{factor: 2}                   {factor: 0.5}              factor
bench[mapmore].n > 2          other[mapmore].n > 2       no source 'other'
bench[mapmore].n > 2          bench[mapmore].n           is no inequality
rows[a].size_m < 3            rows[a].size_m             is no inequality
rows[a].size_m < 3            none[a].size_m < 3         no source 'none'
"rows[a].size_m < 3"          ""                         is no inequality
["rows[a].size_m < 3"]        []                         that the rival would not give
rival: it is none             rival: ""                  the `rival` explanation
holds: ["bench[mapmore].n > 2"], rival  rival             an explanation needs `holds`
untold: no number             untold: ""                 has a verdict
place: [bench.csv]            place: [table 9]           there is no
{file: bench.csv, key         {key                       a source is
"""),
)
def test_wrong_papers(paper, old, new, words, capsys):
    edit(paper, old, new)
    with pytest.raises(PaperError, match=re.escape(words)):
        load_paper(paper)
    assert main([str(paper)]) == 3
    assert words in capsys.readouterr().err


def test_the_command_that_there_was_says_what_to_do_instead(mapmore):
    mapmore(
        "paper", "x.yaml", "--json", "-q", code=2, says=["has left the program", "`make paper`"]
    )
    assert " paper " not in mapmore("--help", code=0).stdout


def write_table(paper, rmse, nrmse):
    rows = [f"bench,{model},{rmse[model]!r},{nrmse[model]!r}" for model in rmse]
    (paper.parent / "table.csv").write_text("\n".join(["study,model,rmse,nrmse", *rows]) + "\n")


def compared(paper, runs, capsys):
    """The exit code, what is printed, and the verdicts."""
    code = main([str(paper), "--runs", str(runs)])
    (found,) = json.loads((runs / "paper.json").read_text(encoding="utf-8"))
    return code, capsys.readouterr(), found


def test_what_agrees_and_what_differs(paper, tmp_path, mapmore, capsys):
    """Our own numbers as the printed ones agree; others differ by kind, each told with its count
    and distance.
    """
    runs = tmp_path / "runs"
    mapmore("validate", tmp_path / "bench.yaml", "-q", code=0)
    held = held_out(json.loads((runs / "bench" / "scores.json").read_text()))
    ours = {
        metric: {model: held[model][metric] for model in ("mapmore", "polynomial_2")}
        for metric in ("rmse", "nrmse")
    }
    write_table(paper, ours["rmse"], ours["nrmse"])
    code, _, found = compared(paper, runs, capsys)
    assert code == 0
    agree = {"size": (2, 2), "value": (2, 2), "order": (1, 1), "claim": (1, 2)}
    assert {
        kind: (count["agree"], count["compared"]) for kind, count in found["counts"].items()
    } == agree
    verdicts = [claim["verdict"] for claim in found["claims"]]
    assert verdicts == ["holds", "does not hold", "untold"]
    assert found["claims"][1]["numbers"] == "2 < 5 < 8; 1 > 3"
    because = [one["verdict"] for item in found["items"] for one in item["because"]]
    assert because == ["holds"]
    swapped = dict(zip(ours["nrmse"], reversed(ours["nrmse"].values()), strict=True))
    write_table(
        paper,
        {"mapmore": 1.9 * ours["rmse"]["mapmore"], "polynomial_2": -ours["rmse"]["polynomial_2"]},
        swapped,
    )
    code, printed, _ = compared(paper, runs, capsys)
    assert code == 0
    for words in (
        "RMSE: 1 of 2 sizes within a factor of 2 (ours are -1 to 0.526 of the printed)",
        "order by NRMSE: 0 of 1 as printed",
    ):
        assert words in printed.out
    html = (runs / "paper.html").read_text(encoding="utf-8")
    assert "A paper of &lt;one&gt; table" in html
    assert "<script" not in html
    assert "src=" not in html
    links = re.findall(r'href="([^"]+)"', html)
    assert all(link.startswith("#") or (runs / link).is_file() for link in links)
    assert any(not link.startswith("#") for link in links)
    assert "<svg" in html


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("published: table.csv", "published: none.csv", "none.csv"),
        ("where: {model: [mapmore, polynomial_2]}", "where: {model: [none]}", "no row"),
        ("where: {model: [mapmore, polynomial_2]}", "where: {modell: [mapmore]}", "no column"),
        ('rows: {model: "{model}"', 'table: none, rows: {model: "{model}"', "no table"),
        ('rows: {model: "{model}"', 'rows: {model: "{none}"', "names no column"),
        ("curve: all}}\n        numbers", "curve: none}}\n        numbers", "0 rows of ours"),
        ("ours: rmse,", "ours: 2*none,", "none"),
        ("bench[mapmore].r2", "bench[none].r2", "0 rows of ours"),
        ("rows[a].size_m / 2", "rows[*].size_m", "2 rows of ours"),
        ("rows[a].size_m / 2", "rows[a].none", "size_m"),
    ],
)
def test_what_is_not_there_is_told_and_the_page_is_written(paper, old, new, words, capsys):
    write_table(paper, {"mapmore": 1.0, "polynomial_2": 2.0}, {"mapmore": 1.0, "polynomial_2": 2.0})
    edit(paper, old, new)
    runs = paper.parent / "runs"
    code, printed, _ = compared(paper, runs, capsys)
    assert code == 3
    assert words in printed.err
    assert words in (runs / "paper.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NUMBERED)
def test_what_tables_of_ours_alone_decide_has_its_numbers_and_explanations_hold(name, tmp_path):
    """What needs a run is judged by `make paper`."""
    spec, folder = (loaded := load_paper(HERE / f"{name}.yaml")).spec, loaded.folder
    runs, root = Runs(tmp_path, folder), folder / spec.root
    for item in spec.items:
        for one in item.compare:
            if one.ours.run is None:
                tables, _ = beside(one, folder, root, runs)
                assert all(cell is not None for row in tables[0].rows for cell in row)
    judge = Judge(runs, spec.sources, root)
    for shown in (*spec.claims, *(reason for item in spec.items for reason in item.why)):
        asked = {match[2] for text in shown.inequalities for match in REFERENCE.finditer(text)}
        if all(spec.sources[one].run is None for one in asked):
            holds, _ = judge.judged(shown)
            assert holds or not isinstance(shown, Reason)
