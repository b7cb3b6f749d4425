"""What README shows stands on the pages."""

import re
from pathlib import Path
from statistics import geometric_mean

import pytest
import yaml
from page_tables import MEMORY, numbers, page_table
from test_shipped_studies import CONFIGS

import mapmore_cli
from mapmore_cli.spec.campaign import load_campaign

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_table_is_that_of_the_pages():
    """Geometric means over the three Festo muscles, the bellows as they are, and medians of the
    steps of coiled muscles.
    """
    lines = [
        line
        for line in README.splitlines()
        if line.startswith("|") and re.search(r"\d", line.split("|")[3])
    ]
    shown = [[float(cell) for cell in re.findall(r"\| +([0-9.]+)", line)] for line in lines]
    campaign, _ = load_campaign(CONFIGS / "campaigns" / "measured_static.yaml")
    rows = {name: numbers(row) for name, row in page_table("measured").items()}
    festo = [
        [f"festo_10mm_{length}cm_{held_out}" for length in (10, 20, 30)]
        for held_out in ("strain", "pressure", "repeat")
    ]
    found = [
        [
            geometric_mean(rows[run]["mapmore"] for run in runs),
            geometric_mean(rows[run]["sarosi"] for run in runs),
            geometric_mean(min(rows[run][model] for model in campaign.best_of) for run in runs),
        ]
        for runs in (*festo, ["bellows_strain"])
    ]
    coiled = numbers(page_table("coiled", MEMORY)["steps: median"])
    others = [error for model, error in coiled.items() if model not in ("mapmore", "repeatability")]
    found.append([coiled["mapmore"], coiled["static"], min(others)])
    assert len(found) == 5
    for line, errors in zip(shown, found, strict=True):
        assert line == pytest.approx(errors, rel=0.006)


def test_where_it_loses_is_what_the_page_says():
    table = {model: row["mean"] for model, row in page_table("pgm").items()}
    assert table["cubic"] == min(
        (told for model, told in table.items() if "inverted" not in model), key=float
    )
    assert f"a cubic has {table['cubic']} % and the direct model {table['mapmore']} %" in README
    measured = page_table("measured")["bellows_strain"]
    assert float(measured["cubic"]) < float(measured["mapmore"])


def test_the_citation_is_whole():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["authors"] == [{"name": "mapmore contributors"}]
    assert citation["version"] == mapmore_cli.__version__


def test_files_that_readme_names_exist():
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).is_file(), target
