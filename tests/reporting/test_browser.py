"""Pages in a browser: tables, saved files, the page of all runs, narrow and dark screens."""

import csv
from pathlib import Path

import pytest
from report_builder import all_named

from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.sketched import sketched
from mapmore_cli.reporting.figures.style import PLAIN
from mapmore_cli.reporting.order import FIGURES
from mapmore_cli.reporting.report import write_report

PAGES = ("fixed", "running", "runs")


def column_of(table, number):
    return [
        row.locator("th, td").nth(number).inner_text() for row in table.locator("tbody tr").all()
    ]


def saved(page, button):
    with page.expect_download() as waiting:
        button.click()
    return waiting.value.suggested_filename, waiting.value.path().read_text(encoding="utf-8")


def test_a_table_is_sorted_by_its_numbers_and_saved(opened):
    """Up, then down; without a number last; the CSV has the rows in the order that is seen."""
    page = opened[1]("fixed")
    table = page.locator("table[data-name=scores]")
    heading = table.locator("thead th", has_text="RMSE [N]").first
    place = [one.inner_text() for one in table.locator("thead th").all()].index(
        heading.inner_text()
    )
    before = column_of(table, place)
    heading.locator("button").click()
    up = column_of(table, place)
    assert heading.get_attribute("aria-sort") == "ascending"
    assert up == sorted(before, key=float)
    heading.locator("button").press("Enter")
    assert column_of(table, place) == up[::-1]
    name, text = saved(page, table.get_by_role("button", name="as CSV"))
    rows = list(csv.reader(text.splitlines()))
    assert name == "scores.csv"
    assert [row[place] for row in rows[1:]] == up[::-1]
    models = table.locator("thead th").first
    models.locator("button").click()
    names = column_of(table, 0)
    assert names == sorted(names, key=str.lower)


def test_figures_are_saved_as_files(opened):
    page = opened[1]("fixed")
    figure = page.locator("figure[data-name=fit]")
    name, text = saved(page, figure.get_by_role("button", name="as SVG"))
    assert name == "fit.svg"
    assert text.startswith("<svg")
    name, text = saved(page, figure.get_by_role("button", name="as CSV"))
    assert name == "fit.csv"
    assert text.startswith("panel,")


def test_runs_are_filtered_sorted_and_compared(opened):
    page = opened[1]("runs", "#filter=sweep")
    rows = page.locator("table.runs tbody tr")
    assert page.locator("#count").inner_text() == "2 of 4"
    assert [row.is_visible() for row in rows.all()] == [True, False, True, False]
    page.get_by_label("Filter").fill("")
    for heading, first in (("alerts", "run0"), ("alerts", "run3"), ("NRMSE", "run1")):
        page.get_by_role("button", name=heading).first.click()
        assert rows.first.locator("th").inner_text().split()[0] == first
    for run in ("run1", "run2"):
        page.get_by_label(f"Compare {run}").check()
    table = page.locator("#comparison table")
    shown = [text.split() for text in table.locator("tbody tr").all_inner_texts()]
    assert shown == [["mapmore", "2.50", "3.50"], ["sarosi", "8.00", "7.00"]]
    page.get_by_label("Compare run3").check()
    assert not table.is_visible()


@pytest.mark.parametrize("width", [400, 1300])
@pytest.mark.parametrize("name", PAGES)
def test_nothing_is_wider_than_the_window(name, width, opened):
    page = opened[1](name, width=width)
    wide = page.evaluate(
        """(width) => {
        for (const one of document.querySelectorAll("details")) one.open = true;
        const free = width > 1000 && document.querySelector(".runs") ? "svg, math, pre"
            : ".scroll, svg, math, pre";
        return [...document.querySelectorAll("body *")]
            .filter((one) => !one.closest(free))
            .filter((one) => one.getBoundingClientRect().right > innerWidth + 1)
            .map((one) => one.className || one.tagName);
    }""",
        width,
    )
    assert wide == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width


CUT = """() => [...document.querySelectorAll("figure svg text")].filter((text) => {
    const words = text.getBoundingClientRect();
    const { left, right } = text.closest(".panel, .key").getBoundingClientRect();
    return words.left < left - 2 || words.right > right + 2;  // a letter has a margin
}).map((text) => text.textContent)"""


def test_no_words_of_a_figure_are_cut(browser):
    """Names of a model's parts at an axis, with wide letters."""
    drawing = Drawing("q", "", (Panel("", named_ticks, "x", ("y",)),), Layout())
    figure = sketched(drawing, PLAIN)
    page = browser.new_page()
    page.set_content(f"<figure>{figure.svg}</figure>")
    assert page.locator("text", has_text="memory").count() == 1
    assert page.evaluate(CUT) == []
    page.context.close()


def named_ticks(ax):
    ax.plot([0.0, 1.0], label="mmmmmmmmm")
    ax.set_yticks([0.0, 1.0], ["memory", "mwMWmw"])


LETTERS = """() => [...document.querySelectorAll("figure text")].map((text) => {
    const { a, b } = text.getScreenCTM();
    return parseFloat(getComputedStyle(text).fontSize) * Math.hypot(a, b);
})"""


@pytest.mark.parametrize("name", ["fixed", "running"])
def test_letters_of_figures_can_be_read_on_a_narrow_screen(name, opened):
    """A panel that is wider than the screen is scrolled in its own box, and does not shrink; a
    narrow one does not grow.
    """
    page = opened[1](name, width=400)
    letters = page.evaluate(LETTERS)
    assert len(letters) > 10
    assert min(letters) >= 9
    assert max(letters) < 15


def test_hostile_names_run_nothing_and_ask_for_nothing(tab, tmp_path):
    """A name is text. If its markup got into a page, the policy of the page would stop it; without
    the policy it does what it says, or this test would find nothing anywhere.
    """
    (page, heard), file = tab, tmp_path / "index.html"
    change = "document.title='owned'"
    name = f"<script>{change}</script><img src='http://127.0.0.1:9/a' onerror=\"{change}\">"
    write_report(all_named(name), tmp_path, tuple(FIGURES), ("html",))
    clean = file.read_text(encoding="utf-8")
    injected = clean.replace("<body>", f"<body>{name}")
    free = injected.replace("Content-Security-Policy", "X-No-Policy")
    for text, harmed in ((clean, False), (injected, False), (free, True)):
        file.write_text(text, encoding="utf-8")
        heard.clear()
        page.goto(file.as_uri())
        assert (page.title() == "owned") is harmed
        assert text != clean or not any(words.startswith("http:") for words in heard)


# axe looks at every element; those within drawings and formulas have no keys and no colours of
# their own, and of a long table a row of each kind is enough
SHORTENED = """() => {
    for (const one of document.querySelectorAll("details")) one.open = true;
    for (const one of document.querySelectorAll("svg, math")) one.replaceChildren();
    for (const row of document.querySelectorAll("tbody tr:nth-child(n + 3)")) row.remove();
}"""


@pytest.mark.parametrize("name", PAGES)
def test_no_finding_of_axe(name, opened):
    """The whole page, with everything unfolded, wide and narrow, light and dark."""
    axe = pytest.importorskip("axe_playwright_python")
    page = opened[1](name)
    page.evaluate((Path(axe.__file__).parent / "axe.min.js").read_text(encoding="utf-8"))
    page.evaluate(SHORTENED)
    for width in (1300, 400):
        page.set_viewport_size({"width": width, "height": 800})
        for scheme, rules in (("light", {}), ("dark", {"runOnly": ["color-contrast"]})):
            page.emulate_media(color_scheme=scheme)
            options = {"resultTypes": ["violations"], **rules}
            violations = page.evaluate("(options) => axe.run(options)", options)["violations"]
            seen = [(one["id"], one["nodes"][0]["html"]) for one in violations]
            assert (width, scheme, seen) == (width, scheme, [])


SCROLLED = """() => [...document.querySelectorAll("body *")]
    .filter((one) => one.scrollWidth > one.clientWidth + 1 && one.clientWidth > 0)
    .filter((one) => getComputedStyle(one).overflowX === "auto")
    .map((one) => [one.tagName, one.tabIndex >= 0, Boolean(one.getAttribute("aria-label"))])"""


@pytest.mark.parametrize("name", PAGES)
def test_what_is_scrolled_is_reached_by_keyboard(name, opened):
    """On a narrow screen, each box that scrolls has a tab stop and a name."""
    page = opened[1](name, width=400)
    page.evaluate("for (const one of document.querySelectorAll('details')) one.open = true")
    boxes = page.evaluate(SCROLLED)
    assert boxes
    assert [box for box in boxes if box[1:] != [True, True]] == []
