"""Realistic inputs of a report: a Sarosi-like surface with noise, cut into even segments with one
term each.
"""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np

from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Equation
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.domain.results import FitResult, Forecast, PiecesFit, Validation
from mapmore_cli.domain.scores import Published, Score
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces import build as pieces
from mapmore_cli.modelling.pieces.recipe import Cuts, Fuse, Recipe
from mapmore_cli.modelling.validation.metrics import divisor, score_rows
from mapmore_cli.modelling.validation.shown import for_report
from mapmore_cli.reporting.figures.drawing import compose, drawings
from mapmore_cli.reporting.figures.style import figure_style
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.order import FIGURES
from mapmore_cli.reporting.sections import all_tables

QUANTITIES = {
    q.name: q
    for q in (
        Quantity("time", "s"),
        Quantity("pressure", "kPa"),
        Quantity("strain", "1"),
        Quantity("force", "N"),
    )
}
PUBLISHED = Published("M2, section 5.1", {"mapmore": 0.022, "sarosi": 0.025, "polynomial_2": 0.07})
FUSE = Fuse(transition="quadratic", extrapolation="continue")


def surface(pressure, strain):
    return (
        pressure * (0.6 * np.exp(-60 * strain) - 9.5 * strain + 2.3)
        - 320 * strain
        - 8 * np.sin(60 * strain)
    )


def free_strain(pressure):
    grid = np.linspace(0, 0.4, 4001)
    return float(grid[np.argmax(surface(np.full_like(grid, pressure), grid) < 5)])


def build(
    levels=(80, 150, 250, 350),
    held_out=lambda level, strain: np.full(len(strain), level == 250),
    competitors=None,
    published=None,
    samples=200,
    segments=4,
    name="dmsp-20-88-static",
    rename=str,
):
    random = np.random.default_rng(7)
    if competitors is None:
        competitors = {
            "sarosi": lambda p, e: surface(p, e) + 9 * np.cos(50 * e),
            "polynomial_2": lambda p, e: p * (2.7 - 12 * e) - 300 * e,
        }
    curves = [_curve(level, samples, held_out, random, rename) for level in levels]
    dataset = Dataset(
        "force",
        "pressure",
        QUANTITIES,
        tuple(_recording(c, random, rename) for c in curves),
        tuple(curves),
        ("1 level was merged.",),
    )
    dictionary = ("1", "strain", "strain^2", "strain^3", "strain^4")
    recipe = Recipe(
        target="force",
        dictionary=dictionary,
        cuts={"strain": Cuts("even", segments)},
        level="pressure",
        fuse=FUSE,
    )
    segmentation = pieces.segment(curves, recipe)
    fit = FitResult(PiecesFit(*pieces.fit(curves, segmentation, recipe)))
    model = pieces.fuse(name, curves, segmentation, fit, recipe, QUANTITIES)
    predictions = {"mapmore": tuple(predict(model, c.columns) for c in curves)}
    predictions |= {
        key: tuple(f(c.columns["pressure"], c.columns["strain"]) for c in curves)
        for key, f in competitors.items()
    }
    formulas = {
        key: _formula(key, failed=all(np.isnan(y).all() for y in predictions[key]))
        for key in competitors
    }
    scored = [key for key in predictions if key not in formulas or not formulas[key].failed]
    scores = _scores(dataset, {key: predictions[key] for key in scored})
    warnings = ("Curve pressure=80 has only four segments of 50 samples.",)
    validation = Validation(predictions, formulas, scores, {"force": "N"}, warnings=warnings)
    equations = tuple(
        Equation(
            f.id,
            f"force = 123.4*((strain - 0.01)/0.05)^2 + 12 = {f.terms[0]}",
            r"F = 123.4 \left(\epsilon\right)^2",
        )
        for f in fit.segments
    )
    return ReportInputs(
        name=name,
        muscle={"name": "Festo DMSP-20-88N", "kind": "mckibben", "length": "88 mm"},
        whole=dataset,
        segmentation=segmentation,
        fit=fit,
        model=model,
        validation=for_report(validation, model, dataset),
        equations=equations,
        published=published,
        spec_text="schema_version: 1\nname: dmsp-20-88-static\ntarget: static\n",
        provenance={"mapmore": "0.1.0", "numpy": "2.0", "sha256 of load_cycle_80.csv": "ab" * 32},
        notes=("Extrapolation: continue, the default of one-term fits.",),
    )


def all_named(text):
    """A study in which whatever a user names or writes is this text."""
    inputs = build(
        name=text,
        rename=lambda name: name + text,
        competitors={text: lambda p, e: p * (2.5 - 10 * e)},
    )
    return replace(
        inputs,
        muscle={"name": text},
        equations=(Equation(text, text, "x"),),  # whose LaTeX is ours
        spec_text=text,
        provenance={text: text},
        notes=(text,),
        validation=replace(inputs.validation, warnings=(text,)),
    )


def _curve(level, samples, held_out, random, rename):
    strain = np.linspace(0, free_strain(level), samples)
    pressure = np.full(samples, float(level))
    force = surface(pressure, strain) + random.normal(0, 2.5, samples)
    columns = {"pressure": pressure, "strain": strain, "force": force}
    return Curve(
        f"pressure={level:g}",
        float(level),
        columns,
        held_out(level, strain),
        (rename(f"load_cycle_{level:g}"),),
    )


def _recording(curve, random, rename):
    time = np.arange(0, 60, 0.02)
    strain = free_strain(float(curve.level)) * (0.5 - 0.5 * np.cos(2 * np.pi * time / 20))
    pressure = curve.level + random.normal(0, 0.8, len(time))
    force = (
        surface(pressure, strain)
        + random.normal(0, 2.5, len(time))
        + 12 * np.sign(-np.sin(2 * np.pi * time / 20))
    )
    columns = {"time": time, "pressure": pressure, "strain": strain, "force": force}
    dropped = (
        {"missing value": 3, "outside `keep`": 20} if curve.level == 80 else {"missing value": 1}
    )
    return Recording(
        curve.recordings[0],
        f"../data/{curve.recordings[0]}.csv.gz",
        columns,
        len(time) + sum(dropped.values()),
        dropped,
    )


def _formula(name, failed):
    if failed:
        nothing = {"a1": np.nan}
        return FormulaFit(
            name,
            nothing,
            nothing,
            "failed",
            "levenberg_marquardt",
            0,
            np.nan,
            np.nan,
            600,
            ("the solver found no step",),
        )
    found, errors = {"a1": 0.6, "a2": -9.5, "a3": 2.3}, {"a1": 0.01, "a2": np.nan, "a3": 0.02}
    return FormulaFit(name, found, errors, "converged", "variable projection", 3, 812.0, 5.0, 600)


def _scores(dataset, predictions):
    """Rows of all models, the training data first."""
    said = {
        model: [Forecast.of(values) for values in found] for model, found in predictions.items()
    }
    rows = [
        row
        for model, found in said.items()
        for row in score_rows(model, "force", found, dataset, divisor(dataset, "max"))
    ]
    return tuple(sorted(rows, key=lambda row: row.split))


def of_pieces(model, **changes):
    """The model with other pieces."""
    return replace(model, body=replace(model.body, **changes))


def drawn(inputs, *names):
    """The figures of these names, of all where none is given."""
    with figure_style():
        return {
            drawing.name: compose(drawing)
            for name in names or FIGURES
            for drawing in drawings(name, inputs)
        }


def legend_of(figure):
    return [label.get_text() for legend in figure.legends for label in legend.get_texts()]


def tables_of(inputs):
    return {table.name: table for table in all_tables(inputs)}


VOID = {"input", "meta", "wbr"}


class Page(HTMLParser):
    """Checks that tags are balanced, and collects what the tests look at."""

    def __init__(self, html):
        super().__init__()
        self.open = []
        self.tags = []
        self.text = ""
        self.scripts = []
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            self.scripts.append(data)
        else:
            self.text += data

    def named(self, tag):
        return [attrs for name, attrs in self.tags if name == tag]


def score(model, nrmse, split="validate", curve="all"):
    """A score of a model that errs by so much of 100 N."""
    return Score(
        model,
        "force",
        split,
        curve,
        10,
        nrmse * 100,
        nrmse,
        100.0,
        f"max|force| over {split}",
        1.0,
        0.01,
        0.9,
    )


class Recorder:
    """Axes that remember every call."""

    def __init__(self):
        self.calls = []

    def __getattr__(self, name):
        def call(*args, **look):
            self.calls.append((name, args, look))
            return Recorder()

        return call

    def named(self, name):
        return [(args, look) for called, args, look in self.calls if called == name]
