"""The module of JavaScript, in Node: every kind of model has the numbers of `predict`."""

import json
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from agreement import difference, points, recording
from common import needs_node
from export_samples import FORMULAS, STATIC, WITH_MEMORY, pieces

from mapmore_cli.annexes.exporting.exports import exported, snippet
from mapmore_cli.annexes.exporting.javascript import javascript_module
from mapmore_cli.domain.models import KeptShape, Shape
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.kinds import fed_back, outside_range, runs_over_time, simulate
from mapmore_cli.modelling.outputs.model import outputs_model
from mapmore_cli.modelling.programs import slopes

POINTS = 801
SHAPED = STATIC["shape between levels"]
KEPT = Shape((KeptShape("strain", "decreasing", 0.0, {}),), 0.05, 0.0)
SEVERAL = outputs_model(
    "both",
    [
        replace(STATIC["steps"], name="both-stiffness", output=Quantity("stiffness", "N/mm")),
        STATIC["two levels"],
    ],
)
OUTPUTS = {f"one of several outputs: {one.output.name}": one for one in SEVERAL.each}
WITHOUT_MEMORY = {**STATIC, **FORMULAS, "a kept shape": replace(SHAPED, shape=KEPT), **OUTPUTS}
MODELS = {**WITHOUT_MEMORY, **WITH_MEMORY}

DRIVER = """
import { readFileSync, writeFileSync } from "node:fs";
const tasks = JSON.parse(readFileSync("tasks.json", "utf8"), (_, x) => x === "NaN" ? NaN : x);
const answers = [];
for (const { file, rows, count } of tasks) {
    const model = await import(file), s = model.reset ? model.reset() : null;
    answers.push(rows.map((row) => {
        const x = row.slice(0, count), y = s ? model.step(s, ...x) : model.evaluate(...x);
        if (Number.isNaN(y) && model.measured) model.measured(s, row[count]);
        const slopes = s ? [] : model.derivatives(...x);
        return [y, Number(model.outsideRange(...x)), ...slopes].map(String);
    }));
}
writeFileSync("answers.json", JSON.stringify(answers));
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Columns, and what Node answers to them: output, outside, derivatives; by model."""
    folder, tasks, given = tmp_path_factory.mktemp("node"), [], {}
    files = exported(SEVERAL, "js", verify=False)
    whole = {name: text.decode() for name, text in zip(OUTPUTS, files.values(), strict=True)}
    for number, (name, model) in enumerate(MODELS.items()):
        (folder / f"m{number}.mjs").write_text(whole.get(name) or javascript_module(model))
        columns = (recording if runs_over_time(model) else points)(model, POINTS)
        names = [*(quantity.name for quantity in model.inputs), *fed_back(model)]
        rows = np.column_stack([columns[one] for one in names]).tolist()
        tasks.append({"file": f"./m{number}.mjs", "rows": rows, "count": len(model.inputs)})
        given[name] = columns
    (folder / "tasks.json").write_text(json.dumps(tasks))
    (folder / "run.mjs").write_text(DRIVER)
    subprocess.run(["node", "run.mjs"], cwd=folder, check=True)
    found = json.loads((folder / "answers.json").read_text().replace("Infinity", "inf"))
    return {
        name: (given[name], np.array(rows, dtype=float))
        for name, rows in zip(given, found, strict=True)
    }


@needs_node
@pytest.mark.parametrize("name", MODELS)
def test_node_has_the_numbers_of_predict(name, answers):
    model, (columns, rows) = MODELS[name], answers[name]
    with np.errstate(all="ignore"):
        assert difference(rows[:, 0], simulate(model, columns).values) < 1e-12
    assert np.array_equal(rows[:, 1], outside_range(model, columns))


@needs_node
@pytest.mark.parametrize("name", WITHOUT_MEMORY)
def test_derivatives_are_those_of_the_program(name, answers):
    columns, rows = answers[name]
    expected = slopes(MODELS[name], columns)
    for place, quantity in enumerate(MODELS[name].inputs):
        found, known = rows[:, 2 + place], expected[quantity.name]
        assert (not known.any() and not found.any()) or difference(found, known) < 1e-12


@needs_node
def test_the_lines_that_call_it_and_a_sample_that_is_not_finite(tmp_path):
    model = WITH_MEMORY["lags"]
    files = exported(model, "js", verify=False)
    (tmp_path / (name := next(iter(files)))).write_bytes(files[name])
    text = snippet(model, "js", list(files))
    text += "console.log(model.step(state, NaN, 0.1), JSON.stringify(state) === "
    text += "JSON.stringify(model.reset()));"
    (tmp_path / "call.mjs").write_text(text)
    done = subprocess.run(
        ["node", "call.mjs"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.split()[1:] == ["NaN", "true"]


def test_no_text_ends_a_script():
    """On a page the module stands between `<script>` and `</script>`, comments included."""
    evil = "</script><!-- <script>"
    model = pieces()
    model = replace(model, name=f"a{evil}", output=replace(model.output, name=f"force{evil}"))
    text = javascript_module(model)
    assert "</script" not in text
    assert "<!--" not in text
