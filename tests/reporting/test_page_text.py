"""Every model and competitor can be computed from the text of its page, by hand as it were.

What is here knows no model: it reads equations and the sentences beside them.
"""

import math
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from common import dataset_of
from export_samples import FORMULAS, STATIC, WITH_MEMORY
from report_builder import build

from mapmore_cli.modelling import simple
from mapmore_cli.modelling.kinds import predict, simulate
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.memory.model import memory_model
from mapmore_cli.reporting.report import render_page
from mapmore_cli.reporting.table import title_of

NUMBER = r"-?[\d.]+(?:e-?\d+)?"
KNOWN = {name: getattr(math, name) for name in ("exp", "log", "sqrt", "tanh", "cos", "sin")}
KNOWN |= {"abs": abs, "sign": lambda x: float(np.sign(x)), "max": max, "min": min}


def named(model):
    """The pieces of a model, named as a fit names them."""
    curves = tuple(
        replace(
            curve,
            segments=tuple(
                replace(one, id=f"pressure={curve.level}/{number}")
                for number, one in enumerate(curve.segments)
            ),
        )
        for curve in model.body.curves
    )
    return replace(model, body=replace(model.body, curves=curves))


def a_sum():
    model = STATIC["a difference"]
    first, *others = model.body.parts
    parts = (replace(first, model=named(first.model)), *others)
    return replace(model, body=replace(model.body, parts=parts))


PIECES = (
    "quadratic, continued straight",
    "widest zones, zero",
    "shape between levels",
    "backbone, shrunken",
    "two variables",
    "no levels",
    "two levels",
    "not held",
)
MOTION = "motion, whatever the direction"
INPUTS = build(samples=40, competitors={})
STATIC_KINDS = (
    {name: named(STATIC[name]) for name in PIECES} | FORMULAS | {"a sum of statics": a_sum()}
)


@pytest.fixture(scope="module")
def polynomial():
    rng = np.random.default_rng(2)
    columns = {"pressure": rng.uniform(50, 500, 90), "strain": rng.uniform(0, 0.3, 90)}
    columns["force"] = columns["pressure"] * (3 - 9 * columns["strain"]) + rng.normal(0, 9, 90)
    fitted = simple.polynomial_fit(3, dataset_of(columns, output="force"), ["pressure", "strain"])
    model = replace(STATIC["steps"], name="cubic", body=fitted.as_pieces())
    (expected,) = fitted.of_curves(dataset_of(columns, output="force"))
    np.testing.assert_allclose(predict(model, columns), expected, rtol=1e-9)
    return model


@pytest.fixture(scope="module")
def arx():
    rng = np.random.default_rng(3)
    columns = {"pressure": 300 + 200 * np.sin(np.arange(400) / 9), "force": np.zeros(400)}
    columns["time"] = 0.01 * np.arange(400)
    for k in range(1, 400):
        columns["force"][k] = 0.95 * columns["force"][k - 1] + 0.02 * columns["pressure"][k - 1]
    columns["force"] += rng.normal(0, 0.1, 400)
    data = dataset_of(columns, output="force")
    fitted, (expected,) = simple.arx(data, ["pressure"])
    memory = fitted.as_memory(data.curves, (0.0, 200.0)).model
    quantities = {one.name: one for one in (STATIC["steps"].output, *STATIC["steps"].inputs)}
    model = replace(memory_model("arx", memory, None, (), quantities), name="arx")
    run = simulate(model, columns).values
    np.testing.assert_allclose(run[200:], expected[200:], rtol=1e-3)  # beginnings are forgotten
    return model


class Text:
    """A competitor as its page prints it: sentences; equations and what stands beside them."""

    def __init__(self, page, title):
        _, _, block = page.partition(f"<h4>{title}</h4>")
        block = re.sub(r'<div class="typeset">.*?</div>', "", block.partition("</article>")[0])
        before, *parts = block.split("<dt>")
        self.words = [unescape(one) for one in re.findall(r'<p class="note">(.*?)</p>', before)]
        self.equations, self.weights = {}, {}
        for part in parts:
            name = unescape(part.partition("</dt>")[0])
            self.equations[name] = unescape(re.search(r'class="line">(.*?)</code>', part)[1])
            note = re.search(r'<p class="note">(.*?)</p>', part)
            self.weights[name] = unescape(note[1]).strip() if note else ""

    def said(self, pattern):
        """The first group of a pattern in the sentences; None where no sentence has it."""
        return next((m[1] for one in self.words if (m := re.search(pattern, one))), None)


def value(text, at):
    """The value of an equation where its quantities have values; `x[k-2]` is a name too."""
    main, _, where = text.partition(", where ")
    names = dict(at)

    def of(expression):
        for name in sorted(names, key=len, reverse=True):
            alone = rf"(?<![\w\]]){re.escape(name)}(?![\w\[])"
            expression = re.sub(alone, f"({float(names[name])!r})", expression)
        return eval(expression.replace("^", "**"), {"__builtins__": {}}, KNOWN)

    for line in filter(None, re.split(r", (?=\w+ = )", where)):
        short, _, meaning = line.partition(" = ")
        names[short] = of(meaning)
    return of(main)


def piece_value(text, name, at):
    """A piece of a curve times its weight, from the sentences about both."""
    weight, held = 1.0, dict(at)
    for part in filter(None, text.weights[name].split("; ")):
        variable = part.partition(" ")[0]
        for verb, start, end in re.findall(rf"(rises|falls) ({NUMBER}) to ({NUMBER})", part):
            t = (at[variable] - float(start)) / (float(end) - float(start))
            w = value(transition(text, t), {"t": min(max(t, 0.0), 1.0)})
            weight *= w if verb == "rises" else 1 - w
        for side, end in re.findall(rf"held (below|above) ({NUMBER})", part):
            held[variable] = (max if side == "below" else min)(held[variable], float(end))
    return weight * value(text.equations[name], held) if weight else 0.0


def transition(text, t):
    """The course of a weight that holds at t."""
    first, _, second = text.said(r"; w = (.*?), with t from").partition(" up to t = 1/2, then ")
    return second if second and t > 0.5 else first


def slope(c, d, u, v):
    return 3 * (u + v) * c * d / ((2 * u + v) * c + (u + 2 * v) * d) if c * d > 0 else 0.0


def end_slope(c, d, u, v):
    found = ((2 * u + v) * c - u * d) / (u + v)
    found = found if found * c > 0 else 0.0
    return min(found, 3 * c, key=abs) if c * d <= 0 else found


def between(text, levels, values, level):
    """What holds between two levels, by the formulas of the sentence."""
    i = next(i for i in range(len(levels) - 1) if levels[i] < level < levels[i + 1])
    t = (level - levels[i]) / (levels[i + 1] - levels[i])
    if text.said("(PCHIP)"):
        h, d = np.diff(levels), np.diff(values) / np.diff(levels)
        slopes = [slope(*d[k - 1 : k + 1], *h[k - 1 : k + 1]) for k in range(1, len(h))]
        slopes = [end_slope(d[0], d[1], h[0], h[1]), *slopes, end_slope(d[-1], d[-2], h[-1], h[-2])]
        own = {"f": values[i], "g": values[i + 1], "h": h[i], "m": slopes[i], "n": slopes[i + 1]}
        result = value(text.said(r"which is (.*?) with the lower"), own | {"t": t})
    else:
        result = (1 - t) * values[i] + t * values[i + 1]
    carried = text.said(r", all times (.*?)\.(?: |$)")
    return result * (value(carried, {"t": t}) if carried else 1.0)


@pytest.fixture(scope="module")
def text_of(polynomial, arx):
    """Returns the text of a competitor on a page that has all of them."""
    models = {**STATIC_KINDS, **WITH_MEMORY, "cubic": polynomial, "arx": arx}
    validation = INPUTS.validation
    (own,) = validation.predictions
    predictions = dict.fromkeys((own, *models, *LEARNERS), validation.predictions[own])
    scores = tuple(replace(validation.scores[0], model=name) for name in predictions)
    changed = {"models": models, "predictions": predictions, "scores": scores}
    inputs = replace(INPUTS, validation=replace(validation, **changed), explore=False)
    html = render_page(inputs, {})
    return lambda name: Text(html, title_of(name))


def by_hand(text, at, within=""):
    """The output at one place, from the text of the page."""
    equations = {name: one for name, one in text.equations.items() if name.startswith(within)}
    if "sum" in equations:
        return summed_by_hand(text, equations["sum"], at)
    by_level = {}
    for name in [one for one in equations if "pressure=" in one]:
        level = name.partition("pressure=")[2].partition("/")[0]
        by_level[level] = by_level.get(level, 0.0) + piece_value(text, name, at)
    base = sum(value(one, at) for name, one in equations.items() if "pressure=" not in name)
    if len(by_level) < 2:
        return base + sum(by_level.values())
    levels, values = [float(one) for one in by_level], [*by_level.values()]
    return base + between(text, levels, values, at["pressure"])


def summed_by_hand(text, line, at):
    """`PART(input = expression, ...) - PART(...)`, each part by its own equations."""
    total = 0.0
    for sign, part, given in re.findall(r"([+-]?) ?([\w-]+)\((.*?)\)(?= [+-]|$)", line):
        own = {
            name: value(of, at)
            for name, _, of in (one.partition(" = ") for one in given.split(", "))
        }
        total += (-1 if sign == "-" else 1) * by_hand(text, own, f"{part}: ")
    return total


@pytest.mark.parametrize("name", STATIC_KINDS)
def test_a_model_is_computed_from_its_text(name, text_of):
    """Three samples of pieces with every joint, formulas and a sum, within the rounding."""
    model, text = STATIC_KINDS[name], text_of(name)
    levels = [one.level for one in getattr(model.body, "curves", ()) if one.level] or [120.0, 330.0]
    ends = {"pressure": (levels[0], levels[-1]), "strain": (0.05, 0.19), "speed": (-0.8, 0.7)}
    places = [
        {
            q.name: low + (high - low) * (0.1 + 0.4 * k)
            for q in model.inputs
            for low, high in [ends.get(q.name, (0.02, 0.3))]
        }
        for k in range(3)
    ]
    columns = {one: np.array([at[one] for at in places]) for one in places[0]}
    found = [by_hand(text, at) for at in places]
    expected = predict(model, columns)
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-3 * np.ptp(expected))


def test_a_polynomial_is_computed_from_its_text(polynomial, text_of):
    text = text_of("cubic")
    for k in range(3):
        at = {"pressure": 100.0 + 150 * k, "strain": 0.02 + 0.1 * k}
        expected = predict(polynomial, {key: np.array([x]) for key, x in at.items()})[0]
        assert by_hand(text, at) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", ["fed back", "lags", "arx", MOTION])
def test_a_recursion_is_run_from_its_text(name, arx, text_of):
    """Two hundred samples, and not only three: the errors of a recursion add up."""
    model = arx if name == "arx" else WITH_MEMORY[name]
    text, t = text_of(name), np.arange(200.0)
    columns = {"pressure": 150 + 60 * np.sin(t / 7), "strain": 0.1 + 0.05 * np.cos(t / 5)}
    columns |= {"time": t * float(text.said(rf"steps of ({NUMBER}) s"))}
    columns |= {"force": np.zeros(200), "angle": np.zeros(200)}
    expected, output = simulate(model, columns).values, model.output.name
    line, found = next(iter(text.equations.values())), expected[:3].tolist()
    for k in range(3, 200):
        past = {f"{one}[k-{i}]": columns[one][k - i] for one in columns for i in range(1, 4)}
        past |= {one: columns[one][k] for one in columns}
        past |= {f"{output}[k-{i}]": x for i, x in enumerate([*reversed(found[-3:])], 1)}
        past |= {
            f"{output}[k-{i}]": 0.0
            for i in range(1, 4)
            if not np.isfinite(past[f"{output}[k-{i}]"])
        }
        found.append(value(line, past))
    np.testing.assert_allclose(found[10:], expected[10:], rtol=0, atol=1e-3 * np.ptp(expected[10:]))


@pytest.mark.parametrize("name", LEARNERS)
def test_a_black_box_says_that_it_is_none(name, text_of):
    text = text_of(name)
    assert text.equations == {}
    assert "black box" in text.words[0]
