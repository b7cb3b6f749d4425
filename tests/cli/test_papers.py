"""`docs/papers` and the five papers there: nothing is without a place, verdicts follow their rules,
the page needs nothing else.
"""

import csv
import re

import pytest
from claims import Judge
from cli_samples import CONFIGS
from comparison import HERE, PUBLISHED, beside
from our_numbers import Runs
from page_tables import DOCS, rows_of
from paper import REFERENCE, Reason, load_paper

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


def test_the_command_that_there_was_says_what_to_do_instead(mapmore):
    mapmore("paper", "x.yaml", "--json", "-q", code=2, says=["no longer exists", "`make paper`"])
    assert " paper " not in mapmore("--help", code=0).stdout


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


def test_the_page_on_reproducing_counts_every_claim():
    """Which of them hold needs the runs; `docs/reproduce_tables.py` writes that."""
    rows = rows_of("papers", DOCS / "reproduce.md")
    assert {row[0].lower() for row in rows} == {*NUMBERED}
    for name, claims, holding, *_ in rows:
        shown = load_paper(HERE / f"{name.lower()}.yaml").spec.claims
        assert int(claims) == sum(not one.untold and one.role == "result" for one in shown)
        assert int(holding) <= int(claims)
