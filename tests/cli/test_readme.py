"""What README shows stands on the pages, and defaults are those of the page about them."""

import re
from pathlib import Path
from statistics import geometric_mean

import pytest
import yaml
from page_tables import MEMORY, numbers, page_table
from test_shipped_studies import CONFIGS

import mapmore_cli
from mapmore_cli.study.campaign import load_campaign
from mapmore_cli.study.loader import load, load_text

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
    pieces = [numbers(row) for row in page_table("backbone").values()][:4]
    found = [
        [
            told["with pieces"],
            told["sarosi_hinged alone"],
            geometric_mean(rows[run]["sarosi"] for run in runs),
            geometric_mean(min(rows[run][model] for model in campaign.best_of) for run in runs),
        ]
        for runs, told in zip((*festo, ["bellows_strain"]), pieces, strict=True)
    ]
    coiled = numbers(page_table("coiled", MEMORY)["steps: median"])
    others = [error for model, error in coiled.items() if model not in ("mapmore", "repeatability")]
    found.append([coiled["mapmore"], coiled["static"], min(others)])
    assert len(found) == 5
    for line, errors in zip(shown, found, strict=True):
        assert line == pytest.approx(errors, rel=0.006)
    assert all(own < backbone for own, backbone, *_ in found[1:3])
    assert all(own > backbone for own, backbone, *_ in (found[0], found[3]))


def value_of(resolved, key):
    """What a spec with all its defaults says of a key, as YAML; a dash where it says nothing."""
    found = yaml.safe_load(resolved)
    for name in key.split("."):
        found = found.get(name) if isinstance(found, dict) else None
    return "–" if found in (None, []) else yaml.safe_dump(found).splitlines()[0]


def test_the_page_of_defaults_has_all_that_differ_from_the_papers(tmp_path):
    """The keys of M2's static study and of the others that it names, beside a spec that says
    nothing of its structure.
    """
    page = (ROOT / "docs" / "defaults.md").read_text(encoding="utf-8")
    bare = "name: a\ntarget: force\ndata: {files: [a.csv], columns: {force: {column: F}}}"
    defaults = load_text(f"schema_version: 1\n{bare}", "bare.yaml", tmp_path).resolved
    shown = re.findall(r"^\| `(.+?)` \| (.+?) \| `(.+?)` \| (.+?) \|", page, re.MULTILINE)
    assert len(shown) >= 6
    for key, paper, study, default in shown:
        resolved = load(CONFIGS / f"{study}.yaml").resolved
        if key == "model.solver":
            assert f"solver: {paper.strip('`')}" in resolved
        elif key != "dictionary":
            assert value_of(resolved, key) == paper.strip("`")
        shown_default = default.strip("`") if default.startswith("`") else "–"
        assert value_of(defaults, key) == shown_default
    papers = load(CONFIGS / "m2" / "dmsp-20-88-static.yaml").resolved
    same = dict(re.findall(r"`([\w.]+): (\S+?)`", page.partition("are the same as in M2")[2]))
    assert same
    assert same == {key: value_of(papers, key) for key in same}
    for section in ("fit", "fuse", "validate"):
        for key in set(yaml.safe_load(papers)[section]) - {"against"}:
            name = f"{section}.{key}"
            differs = value_of(papers, name) != value_of(defaults, name)
            assert differs == (name in [row[0] for row in shown if "static" in row[2]]), name


def test_the_citation_is_whole():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["authors"] == [{"name": "mapmore contributors"}]
    assert citation["version"] == mapmore_cli.__version__


def test_readme_says_what_was_cut_out_of_recordings():
    """One of the ten recordings with steps, and three of the five with loops."""
    names = list(page_table("uncut", MEMORY))
    assert sorted(name.partition("-")[0] for name in names) == ["loops"] * 3 + ["steps"]
    assert "One of them is a recording with steps, in which the clock" in README
    assert "the others are three recordings with loops" in README
    recordings = [name for name in page_table("coiled", MEMORY) if re.match(r"\w+-\d", name)]
    assert sum(name.startswith("steps") for name in recordings) == 10
    assert len(recordings) == 15


def test_each_folder_of_recordings_is_used_by_a_study_or_a_table():
    """As the page about recordings says: nothing was dropped because of its errors."""
    page = (ROOT / "docs" / "data.md").read_text(encoding="utf-8")
    cells = re.findall(r"^\| (`\w+/`.*?) \|", page, re.MULTILINE)
    folders = [name for cell in cells for name in re.findall(r"`(\w+)/`", cell)]
    using = "".join(
        path.read_text(encoding="utf-8")
        for path in (*CONFIGS.rglob("*.yaml"), *(ROOT / "docs" / "search").glob("*.yaml"))
    ) + (ROOT / "docs" / "outlook_tables.py").read_text(encoding="utf-8")
    assert len(folders) >= 19
    assert [name for name in folders if not re.search(rf"[/\"]{name}[/\"]", using)] == []


def test_files_that_readme_names_exist():
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).is_file(), target
