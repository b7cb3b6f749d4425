import shutil
from dataclasses import replace

import numpy as np
import pytest
from export_samples import FORMULAS, SAROSI
from matplotlib.figure import Figure
from report_builder import PUBLISHED, build, surface
from test_memory_report import report_of

from mapmore_cli.domain.scores import Alert
from mapmore_cli.modelling.validation.intervals import left_out_summary
from mapmore_cli.pipeline import runs_page
from mapmore_cli.pipeline.runs_rows import RunRow
from mapmore_cli.reporting.report import write_report


@pytest.fixture(scope="session")
def inputs():
    return build(published=PUBLISHED)


@pytest.fixture(scope="session")
def mixed():
    """Strains between 0.02 and 0.035 held out of every curve."""
    return build(held_out=lambda _level, strain: (strain > 0.02) & (strain < 0.035))


@pytest.fixture(scope="session")
def failed():
    """Sarosi's model could not be fitted, another could."""
    return build(
        competitors={
            "sarosi": lambda p, _e: np.full_like(p, np.nan),
            "flat": lambda p, e: surface(p, e) + 20,
        }
    )


@pytest.fixture(scope="session")
def alone():
    """One curve, nothing held out, no competitor."""
    return build(
        levels=[250],
        held_out=lambda _level, strain: np.zeros(len(strain), dtype=bool),
        competitors={},
    )


@pytest.fixture
def ax():
    return Figure().subplots()


# In a browser
# --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def browser():
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("there is no Chromium here, so pages are not opened")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        arguments = ["--no-sandbox", "--disable-gpu"]
        opened = driver.chromium.launch(executable_path=chromium, args=arguments)
        yield opened
        opened.close()


@pytest.fixture(scope="session")
def pages(inputs, tmp_path_factory):
    """Pages in a folder, and the studies that two of them are of, each with a competitor."""
    folder = tmp_path_factory.mktemp("pages")
    errors = {f"part {k}": [offset + np.zeros(50)] for k, offset in enumerate((3.0, -2.0, 1.0))}
    model = replace(inputs.model, left_out=left_out_summary("recordings", 4, errors))
    sarosi = replace(FORMULAS["sarosi"], body=replace(FORMULAS["sarosi"].body, fit=SAROSI))
    validation = replace(inputs.validation, models={"sarosi": sarosi})
    fixed = replace(inputs, validation=validation, model=model)
    running = report_of(["pressure", "motion[k-1]"])
    own = running.validation.predictions
    models, predictions = {"arx": running.model}, {**own, "arx": own["mapmore"]}
    validation = replace(running.validation, models=models, predictions=predictions)
    studies = {"fixed": fixed, "running": replace(running, validation=validation)}
    for name, study in studies.items():
        write_report(study, folder / name, ("fit", "surface", "error"), ("html",))
    alert = Alert("few curves", "only 1 curve has held-out samples", "fit")
    rows = [
        RunRow(
            run=f"run{number}",
            muscle="a muscle with a long name of many words, McKibben" if number else "",
            campaign="" if number % 2 else "sweep",
            data="load_cycle_080.csv and 3 more",
            target="force",
            split="validate",
            nrmse={"mapmore": 1.5 + number, "sarosi": 9.0 - number} if number else {},
            alerts=(alert,) * number,
            ended=1.7e9 + number,
            picture=("M0 0L9 9", "M0 9L9 0"),
            seconds={"fit": 1.0, "report": 0.5},
        )
        for number in range(4)
    ]
    (folder / "runs").mkdir()
    (folder / "runs" / "index.html").write_text(runs_page._page(folder, rows), encoding="utf-8")
    return folder, studies


@pytest.fixture(scope="session")
def tab(browser):
    """The tab of all tests, because a window costs a second; and what it says and asks for."""
    page, heard = browser.new_page(), []
    page.on("console", lambda message: heard.append(message.text))
    page.on("pageerror", lambda error: heard.append(str(error)))
    page.on("request", lambda asked: heard.append(asked.url))
    return page, heard


@pytest.fixture
def opened(tab, pages):
    """Opens a page; what it says on the console and asks for is a fault."""
    (page, heard), (folder, studies) = tab, pages

    def open_page(name, mark="", width=1300):
        page.goto("about:blank")  # or another mark of the same page would not load it
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme="light")
        page.goto((folder / name / "index.html").as_uri() + mark)
        return page

    heard.clear()
    yield studies, open_page
    # what is saved is asked for from the page itself
    known = ("about:", folder.as_uri(), "blob:", "data:")
    assert [words for words in heard if not words.startswith(known)] == []
