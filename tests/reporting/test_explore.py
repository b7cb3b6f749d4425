"""What a page computes by itself: joints by Node, and the whole section in a browser."""

import json
import math
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from common import needs_node
from export_samples import STATIC, fused
from report_builder import build
from test_memory_report import report_of

from mapmore_cli.domain import plugins
from mapmore_cli.domain.joining import TRANSITIONS
from mapmore_cli.modelling.kinds import predict, simulate
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.modelling.validation.intervals import (
    INTERVAL,
    half_widths_of,
)
from mapmore_cli.reporting import explore
from mapmore_cli.reporting.explore_data import middle_of
from mapmore_cli.reporting.order import FIGURES
from mapmore_cli.reporting.report import render_page, write_report
from mapmore_cli.reporting.scripts import joined, json_text, scripts, text_of

JOINTS = [
    *({"z_s": 0.3, "transition": name, "hold": "none", "side": "zero"} for name in TRANSITIONS),
    {"z_s": 0.0, "transition": "linear", "hold": "samples", "side": "continue"},
    {"z_s": 0.1, "transition": "quadratic", "hold": "samples", "side": "zero"},
    {"z_s": 0.5, "transition": "cubic", "hold": "none", "side": "continue_linear"},
    {"z_s": 0.4, "transition": "cubic", "hold": "samples", "side": "saturate"},
]
NODE = """
import { readFileSync, writeFileSync } from "node:fs";
import { joinedCurve } from "./joining.js";
import { models } from "./code.mjs";
const tasks = JSON.parse(readFileSync("tasks.json", "utf8"));
const answers = tasks.map(({ key, pieces: { curves, variables }, names, joint, rows }) => {
    const code = models[key];
    code.rejoin(curves.map((curve, k) => (
        joinedCurve(curve, code.segments[k], code.slopes[k], variables, names, joint,
            code.transitions[joint.transition]))));
    return rows.map((row) => code.evaluate(...row));
});
writeFileSync("answers.json", JSON.stringify(answers));
"""


def run_module(folder, text, *scripts):
    """Run a module of Node beside scripts of the page."""
    for name in scripts:
        (folder / name).write_text(text_of(name))
    (folder / "package.json").write_text('{"type": "module"}')
    (folder / "run.js").write_text(text)
    subprocess.run(["node", "run.js"], cwd=folder, check=True)


@needs_node
def test_pieces_are_joined_as_python_joins_them(tmp_path):
    """Every transition and side, at and beyond the limits, with levels and two variables."""
    names = ["steps", "two variables", "shape between levels", "no levels", "backbone, shrunken"]
    code, tasks, expected = "", [], []
    for number, model in enumerate(STATIC[name] for name in names):
        bare, more = explore.bare_of(model)
        key = f"m{number}"
        code += explore.wrapped(key, bare, more)
        body, inputs = model.body, [one.name for one in model.inputs]
        free = [name for name in inputs if name != body.level]
        rng = np.random.default_rng(number)
        ends = {"pressure": (50, 560), "strain": (-0.1, 0.5), "speed": (-2, 3)}
        rows = np.column_stack([rng.uniform(*ends[name], 200) for name in inputs])
        columns = dict(zip(inputs, rows.T, strict=True))
        for joint in JOINTS:
            sides = dict(body.fusion.extrapolation)
            sides |= dict.fromkeys(free, (joint["side"], joint["side"]))
            how = {name: value for name, value in joint.items() if name != "side"}
            task = {"key": key, "pieces": explore.pieces_of(model, {}), "names": free}
            tasks.append({**task, "joint": {**how, "extrapolation": sides}, "rows": rows.tolist()})
            expected.append(predict(fused(model, extrapolation=sides, **how), columns))
    head = "export const models = {};\nconst mapmore = { models };\n"
    (tmp_path / "code.mjs").write_text(head + code)
    (tmp_path / "tasks.json").write_text(json.dumps(tasks))
    run_module(tmp_path, NODE, "joining.js")
    answers = json.loads((tmp_path / "answers.json").read_text())
    for known, found in zip(expected, answers, strict=True):
        np.testing.assert_allclose(
            np.array(found, dtype=float), known, rtol=1e-10, atol=1e-10 * np.abs(known).max()
        )


def test_a_page_without_explore_has_no_script(inputs, monkeypatch):
    """`report.explore: false`, and the exporting annex missing: but for that of all tables."""
    tables = [one.text for one in scripts([joined("tables.js")])]

    def scripts_of(page):
        return re.findall(r"<script[^>]*>(.*?)</script>", page, re.DOTALL)

    assert scripts_of(render_page(replace(inputs, explore=False), {})) == tables

    def missing(_group, _name):
        raise plugins.NotInstalled("`export` is not installed", "install it")

    monkeypatch.setattr(explore.plugins, "load", missing)
    assert scripts_of(render_page(inputs, {})) == tables


def test_a_page_of_many_samples_stays_small(tmp_path):
    """Of ten thousand samples: figures of short steps, and as many numbers as can be seen."""
    inputs = build(samples=2500)
    write_report(inputs, tmp_path, tuple(FIGURES), ("html",))
    assert (tmp_path / "index.html").stat().st_size < 900e3
    samples = explore.explored([inputs]).outputs[0]["samples"]
    assert len(samples["trained"]["force"]) <= 2000
    held = int(inputs.pooled_held_out.sum())
    assert len(samples["held"]["force"]) == samples["all_held"] == held


def test_a_model_of_many_segments_is_not_computed_on_the_page(inputs, monkeypatch):
    monkeypatch.setattr(explore, "MOST_SEGMENTS", len(inputs.model.pieces.segments) - 1)
    assert explore.explored([inputs]) is None
    page = render_page(inputs, {})
    assert "the code of its 12 segments" in page
    assert f"mapmore export {inputs.name} --to js" in page
    assert "the code of its" not in render_page(replace(inputs, explore=False), {})


def test_a_held_out_loop_is_opened_in_the_middle_of_its_range():
    there_and_back = np.concatenate([np.arange(0.0, 10.0), np.arange(10.0, 0.0, -1.0)])
    assert there_and_back[middle_of(np.arange(20), there_and_back)] == 5.0
    assert middle_of(np.array([4, 7, 9]), np.array([2.0, np.nan, 1.0])) == 4


def test_no_text_ends_a_script():
    assert json_text({"a": "</script><!--"}) == '{"a":"\\u003c/script>\\u003c!--"}'
    with pytest.raises(ValueError, match="would end the HTML element"):
        scripts(["let a = '</script>';"])


def test_our_own_scripts_stay_small():
    """Below 700 lines in all, of at most 100 columns, beside the one library."""
    folder = Path(explore.__file__).parent / "scripts"
    own = [path for path in folder.glob("*.js") if path.name != "uplot.js"]
    lines = [line for path in own for line in path.read_text(encoding="utf-8").splitlines()]
    assert len(lines) < 700
    assert max(map(len, lines)) <= 100


def test_the_vendored_library_is_the_published_one():
    """`make vendored` renews it; a change of a byte is none of ours."""
    from hashlib import sha256

    folder = Path(explore.__file__).parent / "scripts"
    for line in (folder / "vendored.sha256").read_text().splitlines():
        known, name = line.split()
        assert sha256((folder / name).read_bytes()).hexdigest() == known, name
    assert "(v1.6.32)" in text_of("uplot.js")[:100]


# In a browser
# --------------------------------------------------------------------------------------------------


def shown(page, place=0):
    """The number behind a reading, in full."""
    return float(page.locator("output.reading").nth(place).get_attribute("data-value"))


def set_number(page, name, value):
    page.get_by_label(f"{name} as a number", exact=True).fill(str(value))


def test_a_slider_shows_the_value_of_predict(opened):
    studies, open_page = opened
    page, model = open_page("fixed"), studies["fixed"].model
    for pressure, strain in ((120.0, 0.05), (300.0, 0.013), (500.0, 0.4)):
        set_number(page, "pressure", pressure)
        set_number(page, "strain", strain)
        columns = {"pressure": np.array([pressure]), "strain": np.array([strain])}
        assert shown(page) == pytest.approx(predict(model, columns)[0], rel=1e-12)
        assert page.locator(".beyond").count() == (strain == 0.4)
    set_number(page, "strain", 0.05)
    set_number(page, "pressure", 300)
    half = half_widths_of(model, {"pressure": np.array([300.0])}, INTERVAL)[0]
    text = page.locator("output.reading").first.inner_text()
    assert float(re.search(r"± (\S+) \(95 %\)", text)[1]) == pytest.approx(half, rel=1e-3)
    set_number(page, "strain", 0.4)
    page.get_by_label("pressure", exact=True).press("ArrowRight")
    slid = float(page.get_by_label("pressure", exact=True).input_value())
    columns = {"pressure": np.array([slid]), "strain": np.array([0.4])}
    assert shown(page) == pytest.approx(predict(model, columns)[0], rel=1e-12)


def test_another_joint_has_the_error_that_a_run_would_have(opened):
    studies, open_page = opened
    page, inputs = open_page("fixed"), studies["fixed"]
    held = inputs.pooled_held_out
    columns = {one.name: inputs.pooled(one.name)[held] for one in inputs.model.inputs}
    measured = inputs.pooled("force")[held]

    def rmse(**how):
        return math.sqrt(np.mean((predict(fused(inputs.model, **how), columns) - measured) ** 2))

    assert shown(page, 1) == pytest.approx(rmse(), rel=1e-5)  # of samples of seven digits
    set_number(page, "z_s", 0.1)
    page.get_by_label("transition", exact=True).select_option("cubic")
    assert shown(page, 1) == pytest.approx(rmse(z_s=0.1, transition="cubic"), rel=1e-5)
    fuse = yaml.safe_load(page.locator(".yaml").inner_text())["fuse"]
    assert Fuse(**fuse).z_s == 0.1  # the section of a spec, whole
    assert Fuse(**fuse).transition == "cubic"
    assert fuse.keys() == {"transition", "z_s", "levels", "hold", "extrapolation"}
    page.locator(".segments button").first.click()
    assert page.locator(".equation").inner_text() != ""


def test_a_click_on_a_piece_shows_its_equation(opened):
    """In the drawing of the functions and in that of the weights, at both ends of the curve."""
    page = opened[1]("fixed")
    names = page.locator(".segments button").all_inner_texts()
    assert len(names) > 1
    for chart in page.locator(".pieces .u-over").all():
        size = chart.bounding_box()
        for part, name in ((0.02, names[0]), (0.98, names[-1])):
            chart.click(position={"x": part * size["width"], "y": size["height"] / 2})
            assert page.locator(".equation").inner_text().startswith(f"{name}: ")


PIXELS = """() => [...document.querySelectorAll("canvas")]
    .map((one) => one.toDataURL()).join()"""


@pytest.mark.parametrize(("name", "title"), [("fixed", "Sárosi"), ("running", "ARX")])
def test_a_competitor_is_switched_on_and_colours_follow_the_screen(name, title, opened):
    """It is drawn beside the model, and everything is painted again on a dark screen and back."""
    studies, open_page = opened
    page = open_page(name)

    def painted(last):
        """The pixels, once others than the last ones are there."""
        page.wait_for_function(f"(last) => ({PIXELS})() !== last", arg=last)
        return page.evaluate(PIXELS)

    alone = page.evaluate(PIXELS)
    page.get_by_role("checkbox", name=title).check()
    beside = painted(alone)
    page.emulate_media(color_scheme="dark")
    dark = painted(beside)
    page.emulate_media(color_scheme="light")
    assert painted(dark) == beside
    if name == "fixed":
        (model,) = studies[name].validation.models.values()
        columns = {"pressure": np.array([300.0]), "strain": np.array([0.05])}
        found = page.evaluate("mapmore.models['model0.0'].evaluate(300, 0.05)")
        assert found == pytest.approx(predict(model, columns)[0], rel=1e-12)


def test_what_lies_beyond_the_range_is_dashed_with_memory_too(opened):
    """No pixel of the solid line is where the input is beyond its training range."""
    page = opened[1]("running")
    page.evaluate(
        """() => {
        window.dashes = [];
        const { setLineDash } = CanvasRenderingContext2D.prototype;
        CanvasRenderingContext2D.prototype.setLineDash = function (dash) {
            window.dashes.push(dash.length);
            return setLineDash.call(this, dash);
        };
    }"""
    )
    set_number(page, "amplitude", 900)
    assert "beyond the training range" in page.locator("output.reading").inner_text()
    assert 2 in page.evaluate("window.dashes")


@needs_node
def test_a_line_is_dashed_up_to_the_samples_within_the_range(tmp_path):
    text = """
        import { writeFileSync } from "node:fs";
        import { byRange } from "./controls.js";
        const parts = byRange([0, 1, 2, 3], [5, 6, 7, 8], [false, true, false, false]);
        writeFileSync("parts.json", JSON.stringify(parts.map((part) => part.y)));"""
    run_module(tmp_path, text, "controls.js", "elements.js")
    parts = json.loads((tmp_path / "parts.json").read_text())
    assert parts == [[5, 6, 7, None], [5, None, 7, 8]]


def test_why_there_is_no_interval_stands_there(opened, inputs):
    """A study that asks for none; one whose recordings do not tell; one that has them."""
    from mapmore_cli.modelling.validation.intervals import with_levels

    two = replace(opened[0]["fixed"].model.left_out, kind="levels", curves=2, places=(80.0, 350.0))
    two = with_levels(two, {80.0: [np.ones(9)], 350.0: [np.ones(9)]}, 1)
    told = [
        explore.explored([replace(inputs, model=replace(inputs.model, left_out=one))]).outputs[0]
        for one in (None, two, opened[0]["fixed"].model.left_out)
    ]
    assert "does not ask for one" in told[0]["no_interval"]
    assert "2 levels do not show" in told[1]["no_interval"]
    assert told[2]["no_interval"] == ""


def test_the_page_says_with_what_a_free_run_begins(opened):
    """A model that feeds its output back needs measured values; another one begins at rest."""
    note = opened[1]("running").locator("section.explore .note").all_inner_texts()
    assert any("those measured at the beginning of the recording" in text for text in note)
    without = report_of(["pressure[k-1]"])
    (study,) = explore.explored([without]).outputs
    assert study["record"]["begins"] == (
        "A run of the model begins at rest, without measured motion."
    )


def test_a_model_with_memory_runs_freely(opened):
    studies, open_page = opened
    page, inputs = open_page("running"), studies["running"]
    count = round(30 / 0.01)
    held = {one.name: inputs.pooled(one.name) for one in inputs.model.inputs}
    resting = {name: np.full(count, (x.min() + x.max()) / 2) for name, x in held.items()}
    start = inputs.pooled("motion")[np.argmax(inputs.pooled_held_out)]
    resting |= {"time": 0.01 * np.arange(count), "motion": np.full(count, start)}
    expected = simulate(inputs.model, resting).values[-1]
    assert shown(page) == pytest.approx(expected, rel=1e-4)  # knobs of seven digits
    page.get_by_label("Course", exact=True).select_option("record")
    held, number = inputs.pooled_held_out, int(np.argmax(inputs.pooled_held_out))
    columns = {name: inputs.pooled(name)[held] for name in inputs.dataset.quantities}
    errors = simulate(inputs.model, columns).values - columns["motion"]
    assert number > 0
    assert shown(page) == pytest.approx(math.sqrt(np.nanmean(errors**2)), rel=1e-3)


def test_it_is_readable_with_scripts_off(browser, pages):
    page = browser.new_page(java_script_enabled=False)
    page.goto((pages[0] / "fixed" / "index.html").as_uri())
    assert "needs scripts" in page.locator("section.explore").inner_text()
    assert page.locator(".verdict").is_visible()
    assert page.locator("figure svg").first.is_visible()
    page.context.close()
