import csv
import re
import xml.etree.ElementTree as ET
from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from itertools import pairwise
from pathlib import Path

import pytest
from common import python
from report_builder import Page, all_named

from mapmore_cli.domain.plugins import entry_points
from mapmore_cli.modelling.kinds import equations
from mapmore_cli.reporting import figures as figures_folder
from mapmore_cli.reporting.order import FIGURES
from mapmore_cli.reporting.report import write_report
from mapmore_cli.reporting.sections import SECTIONS, all_tables

EVERYTHING = {"figures": tuple(FIGURES), "formats": ("html", "csv", "svg")}


@pytest.fixture(scope="module")
def folder(inputs, tmp_path_factory):
    out = tmp_path_factory.mktemp("report") / "new" / "report"
    write_report(inputs, out, **EVERYTHING)
    return out


@pytest.fixture(scope="module")
def page(folder):
    return Page((folder / "index.html").read_text(encoding="utf-8"))


def test_figures_and_sections_have_their_files():
    folder = Path(figures_folder.__file__).parent
    drawn = {path.stem for path in folder.glob("*.py") if "\ndef draw(" in path.read_text()}
    assert drawn == {*FIGURES} - {*entry_points("figures")}
    sections = {section.id for section in SECTIONS}
    assert {*FIGURES.values()} <= sections
    templates = (folder.parent / "templates/sections").iterdir()
    assert {path.stem.partition("_")[0] for path in templates} <= {"explore", *sections}


def page_of(inputs, out, figures=tuple(FIGURES)):
    write_report(inputs, out, figures, ("html",))
    return Page((out / "index.html").read_text(encoding="utf-8"))


def test_files(folder):
    drawn = {*FIGURES} - {*entry_points("figures")}
    assert {path.stem for path in folder.glob("*.svg")} == {
        *(*drawn, "fit_training", "segments_levels")
    }
    names = {path.stem for path in (folder / "tables").glob("*.csv")}
    assert {
        "scores",
        "recordings",
        "levels",
        "segments",
        "terms",
        "coefficients",
        "equations",
        "formulas",
    } <= names


def test_only_the_formats_and_figures_asked_for(inputs, tmp_path):
    write_report(inputs, tmp_path / "none", (), ("pdf",))
    assert not [*(tmp_path / "none").iterdir()]  # but the folder of the stage is there
    write_report(inputs, tmp_path / "a", ("nrmse",), ("svg",))
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["nrmse.svg"]
    write_report(inputs, tmp_path / "b", ("nrmse",), ("csv", "tex"))
    assert [path.name for path in (tmp_path / "b").iterdir()] == ["tables"]
    rows = {table.name: table.rows for table in all_tables(inputs)}
    for suffix, names in (("csv", {*rows}), ("tex", {name for name in rows if rows[name]})):
        assert {path.stem for path in (tmp_path / "b" / "tables").glob(f"*.{suffix}")} == names
    write_report(inputs, tmp_path / "c", ("nrmse",), ("html",))
    assert [path.name for path in (tmp_path / "c").iterdir()] == ["index.html"]
    assert (
        len(Page((tmp_path / "c" / "index.html").read_text(encoding="utf-8")).named("figure")) == 1
    )


ELSEWHERE = """
import sys
from pathlib import Path
sys.path[:0] = sys.argv[1:3]
from report_builder import PUBLISHED, build
from test_reporting_page import EVERYTHING, PAPER, write_report
for out, what in zip(sys.argv[3:], (EVERYTHING, PAPER)):
    write_report(build(published=PUBLISHED), Path(out), **what)
"""
PAPER = {"figures": ("nrmse",), "formats": ("pdf", "png", "pgf")}


def test_another_process_on_another_day_writes_the_same_bytes(inputs, folder, tmp_path):
    later = {"PYTHONHASHSEED": "77", "SOURCE_DATE_EPOCH": "1234567890", "TZ": "Asia/Tokyo"}
    paper, others = tmp_path / "paper", [tmp_path / "a", tmp_path / "b"]
    write_report(inputs, paper, **PAPER)
    python(ELSEWHERE, *Path(__file__).parents[:2], *others, check=True, env=later)
    for ours, theirs in zip((folder, paper), others, strict=True):
        for path in filter(Path.is_file, ours.rglob("*")):
            assert path.read_bytes() == (theirs / path.relative_to(ours)).read_bytes(), path.name


def test_svg_files_are_well_formed_and_without_dates(folder):
    for path in folder.glob("*.svg"):
        root = ET.parse(path).getroot()
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        assert root.get("aria-label")
        assert not list(root.iter("{http://www.w3.org/2000/svg}metadata"))
        assert list(root.iter("{http://www.w3.org/2000/svg}text")), "text is text, not outlines"


def test_nothing_is_fetched(page, folder):
    assert not page.named("link")
    assert not page.named("img")
    for tag, attrs in page.tags:
        for name in ("src", "href", "xlink:href"):
            assert (attrs.get(name) or "#").startswith("#"), (tag, attrs)
        assert not any(name.startswith("on") for name in attrs)
    html = (folder / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"@import|url\((?!#)", html)


def test_the_page_forbids_what_it_does_not_need(page):
    (policy,) = (
        attrs["content"]
        for attrs in page.named("meta")
        if attrs.get("http-equiv") == "Content-Security-Policy"
    )
    allowed = dict(part.split(maxsplit=1) for part in policy.split("; "))
    hashes = [
        f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"
        for attrs, text in zip(page.named("script"), page.scripts, strict=True)
        if "type" not in attrs
    ]
    assert len(hashes) == 3  # uPlot, the models, and the modules of the page
    assert allowed == {
        "default-src": "'none'",
        "script-src": " ".join(hashes),
        "style-src": "'unsafe-inline'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }


def test_accessible(page):
    assert page.named("html") == [{"lang": "en"}]
    assert all(
        attrs.get("role") == "img" and attrs.get("aria-label") for attrs in page.named("svg")
    )
    assert all(attrs.get("scope") in ("col", "row") for attrs in page.named("th"))
    assert len(page.named("caption")) == len(page.named("table"))
    headings = [int(tag[1]) for tag, _ in page.tags if re.fullmatch(r"h\d", tag)]
    assert headings[0] == 1
    assert headings.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(headings))


def test_links_lead_somewhere_and_section_ids_are_unique(page, folder):
    ids = [attrs["id"] for _, attrs in page.tags if attrs.get("id")]
    sections = [attrs["id"] for attrs in page.named("h2")]
    assert {*sections} == {"explore", *(section.id for section in SECTIONS)}
    assert len(sections) == len(SECTIONS) + 1
    assert all(ids.count(name) == 1 for name in sections)
    assert all(attrs["href"].removeprefix("#") in sections for attrs in page.named("a"))
    for attrs in page.named("use"):
        assert attrs["xlink:href"].removeprefix("#") in ids


def test_order_of_the_sections(page):
    titles = [
        "Scores by curve",
        "Scores of all models",
        "Scores (target: force)",
        "The model in physical units",
        "Limits: the ranges in which the model was trained",
        "Your data as read",
        "Rows of every recording",
        "Segments and their weights",
        "Coefficients with 95 %",
        "Parameters of the fitted formulas",
        "Provenance",
    ]
    places = [page.text.rindex(title) for title in titles]
    assert places == sorted(places)


def test_says_what_it_should(page, inputs):
    for words in (
        "mapmore predicts force",
        "the best competitor (Sárosi)",
        "M2, section 5.1",
        "Festo DMSP-20-88N",
        *inputs.notes,
        *inputs.validation.warnings,
        *inputs.dataset.notes,
    ):
        assert words in page.text
    (own,) = (row for row in inputs.validation.scores
              if (row.model, row.split, row.curve) == ("mapmore", "validate", "all"))  # fmt: skip
    assert f"Its RMSE is {own.rmse:.3g} N" in page.text
    assert inputs.spec_text in page.text
    assert inputs.equations[0].text in page.text


def test_the_model_is_typeset_with_weights_and_limits(inputs, tmp_path):
    page = page_of(replace(inputs, equations=equations(inputs.model)), tmp_path, ("fit",))
    html = (tmp_path / "index.html").read_text(encoding="utf-8")
    typeset = re.findall(r"<math[^>]*>.*?</math>", html)
    assert len(typeset) >= 2 * len(inputs.model.body.segments)
    for one in typeset:
        ET.fromstring(one)
    assert "strain rises" in page.text
    assert "w = 2*t^2 up to" in page.text
    assert "Limits: the ranges in which the model was trained" in page.text
    ids = [attrs["id"] for attrs in page.named("h2")]
    assert ids.index("equations") == 3, "third on the page, after what can be explored"


HOSTILE = "<script>alert('1')</script>&\"$x_1$ ü 力"


def test_names_with_special_characters_are_escaped(tmp_path):
    write_report(all_named(HOSTILE), tmp_path, **EVERYTHING)
    page = Page((tmp_path / "index.html").read_text(encoding="utf-8"))
    assert not any("<script" in text for text in page.scripts)
    assert page.text.count(HOSTILE) > 12
    for path in tmp_path.glob("*.svg"):
        assert not list(ET.parse(path).getroot().iter("{http://www.w3.org/2000/svg}script"))
    with (tmp_path / "tables" / "formulas.csv").open(encoding="utf-8", newline="") as file:
        assert {row["formula"] for row in csv.DictReader(file)} == {HOSTILE}


def test_failed_fits_show_as_failed_and_never_as_numbers(failed, tmp_path):
    models = ("fit", "error", "nrmse", "bands")
    write_report(failed, tmp_path, models, EVERYTHING["formats"])
    page = Page((tmp_path / "index.html").read_text(encoding="utf-8"))
    assert "These competitors failed, and have no prediction: sarosi." in page.text
    assert "the solver found no step" in page.text
    for path in (path for path in tmp_path.rglob("*") if path.is_file()):
        text = re.sub("<script>.*?</script>", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert not re.search(r"\bnan\b", text, re.IGNORECASE), path.name
