"""Realistic inputs of a report: a Sarosi-like surface with noise, cut into even segments with one term each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapmore_cli.domain.fits import FormulaFit, Scaling, Segment, SegmentedCurve, SegmentFit, Selection
from mapmore_cli.domain.models import CurveFunction, Equation, Fusion, Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.domain.results import FitResult, PiecesFit, Validation
from mapmore_cli.domain.scores import Published, Score
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.reporting.inputs import ReportInputs

QUANTITIES = {q.name: q for q in (Quantity("time", "s"), Quantity("pressure", "kPa"), Quantity("strain", "1"), Quantity("force", "N"))}
CANDIDATES = ("1", "strain", "strain^2", "strain^3", "strain^4")
Prediction = Callable[[np.ndarray, np.ndarray], np.ndarray]


def surface(pressure: np.ndarray, strain: np.ndarray) -> np.ndarray:
    return pressure * (0.6 * np.exp(-60 * strain) - 9.5 * strain + 2.3) - 320 * strain - 8 * np.sin(60 * strain)


def free_strain(pressure: float) -> float:
    grid = np.linspace(0, 0.4, 4001)
    return float(grid[np.argmax(surface(np.full_like(grid, pressure), grid) < 5)])


def build(
    levels: Sequence[float] = (80, 150, 250, 350),
    held_out: Callable[[float, np.ndarray], np.ndarray] = lambda level, strain: np.full(len(strain), level == 250),
    competitors: Mapping[str, Prediction] | None = None,
    published: Published | None = None,
    samples: int = 200,
    segments: int = 4,
    name: str = "dmsp-20-88-static",
    rename: Callable[[str], str] = str,
) -> ReportInputs:
    random = np.random.default_rng(7)
    if competitors is None:
        competitors = {"sarosi": lambda p, e: surface(p, e) + 9 * np.cos(50 * e), "polynomial_2": lambda p, e: p * (2.7 - 12 * e) - 300 * e}
    curves = [_curve(level, samples, held_out, random, rename) for level in levels]
    dataset = Dataset(
        "force", "pressure", QUANTITIES, tuple(_recording(c, random, rename) for c in curves), tuple(curves), ("1 level was merged.",)
    )
    trained = [c for c in curves if not c.held_out.all()]
    segmentation = tuple(_segmented(c, segments) for c in trained)
    fit = FitResult(PiecesFit(tuple(_segment_fit(c, s) for c, cut in zip(trained, segmentation, strict=True) for s in cut.segments)))
    model = _model(name, segmentation, fit)
    predictions = {"mapmore": tuple(predict(model, c.columns) for c in curves)}
    predictions |= {key: tuple(f(c.columns["pressure"], c.columns["strain"]) for c in curves) for key, f in competitors.items()}
    formulas = {key: _formula(key, failed=all(np.isnan(y).all() for y in predictions[key])) for key in competitors}
    scored = {key: y for key, y in predictions.items() if key not in formulas or not formulas[key].failed}
    validation = Validation(
        predictions,
        formulas,
        tuple(_scores(curves, scored)),
        {"force": "N"},
    )
    equations = tuple(
        Equation(f.id, f"force = 123.4*((strain - 0.01)/0.05)^2 + 12 = {f.terms[0]}", r"F = 123.4 \left(\epsilon\right)^2")
        for f in fit.segments
    )
    return ReportInputs(
        name=name,
        muscle={"name": "Festo DMSP-20-88N", "kind": "mckibben", "length": "88 mm"},
        target=QUANTITIES["force"],
        dataset=dataset,
        segmentation=segmentation,
        fit=fit,
        model=model,
        validation=validation,
        equations=equations,
        published=published,
        spec_text="schema_version: 1\nname: dmsp-20-88-static\ntarget: static\n",
        provenance={"mapmore": "0.1.0", "numpy": "2.0", "sha256 of load_cycle_80.csv": "ab" * 32},
        notes=("Extrapolation: continue, the default of one-term fits.",),
        warnings=("Curve pressure=80 has only four segments of 50 samples.",),
    )


def _curve(level, samples, held_out, random, rename) -> Curve:
    strain = np.linspace(0, free_strain(level), samples)
    pressure = np.full(samples, float(level))
    force = surface(pressure, strain) + random.normal(0, 2.5, samples)
    columns = {"pressure": pressure, "strain": strain, "force": force}
    return Curve(f"pressure={level:g}", float(level), columns, held_out(level, strain), (rename(f"load_cycle_{level:g}"),))


def _recording(curve: Curve, random, rename) -> Recording:
    time = np.arange(0, 60, 0.02)
    strain = free_strain(float(curve.level)) * (0.5 - 0.5 * np.cos(2 * np.pi * time / 20))
    pressure = curve.level + random.normal(0, 0.8, len(time))
    force = surface(pressure, strain) + random.normal(0, 2.5, len(time)) + 12 * np.sign(-np.sin(2 * np.pi * time / 20))
    columns = {"time": time, "pressure": pressure, "strain": strain, "force": force}
    dropped = {"missing value": 3, "outside `keep`": 20} if curve.level == 80 else {"missing value": 1}
    return Recording(curve.recordings[0], f"../data/{curve.recordings[0]}.csv.gz", columns, len(time) + sum(dropped.values()), dropped)


def _segmented(curve: Curve, count: int) -> SegmentedCurve:
    rows = np.flatnonzero(~curve.held_out)
    strain = curve.columns["strain"][rows]
    boundaries = np.linspace(strain[0], strain[-1], count + 1)
    cell = np.clip(np.searchsorted(boundaries, strain, side="right"), 1, count)
    segments = tuple(Segment(f"{curve.id}/strain:{i}", curve.id, (i,), rows[cell == i]) for i in range(1, count + 1))
    limits = {"strain": (float(strain[0]), float(strain[-1])), "pressure": (float(curve.level), float(curve.level))}
    return SegmentedCurve(curve.id, curve.level, ("strain",), (boundaries,), limits, segments)


def _segment_fit(curve: Curve, segment: Segment) -> SegmentFit:
    strain, force = (curve.columns[name][segment.rows] for name in ("strain", "force"))
    x = (strain - strain[0]) / np.ptp(strain)
    y_slope, y_intercept = float(np.ptp(force)), float(force[0])
    y = (force - y_intercept) / y_slope
    P = np.column_stack([x**i for i in range(5)])
    g = P.T @ y / np.sum(P**2, axis=0)
    err = g**2 * np.sum(P**2, axis=0) / (y @ y)
    order = np.argsort(-err)
    best = int(order[0])
    sse = float(np.sum((y - g[best] * P[:, best]) ** 2))
    chosen = np.array([best])
    runner_up, tied, condition = order[1:2], np.zeros(1, int), 1.0
    theta_error = np.array([np.sqrt(sse / (len(y) - 1) / np.sum(P[:, best] ** 2))])
    selection = Selection(
        chosen, g[chosen], err[chosen], g[chosen], theta_error, np.eye(1), g[None], err[None], runner_up, tied, condition,
        sse, float(y @ y), len(y), "max_terms",
    )  # fmt: skip
    scaling = Scaling(
        "unit_square", "left", ("strain",), np.array([1 / np.ptp(strain)]), np.array([-strain[0] / np.ptp(strain)]), y_slope, y_intercept
    )
    return SegmentFit(segment.id, curve.id, segment.cell, CANDIDATES, scaling, selection)


def _model(name: str, segmentation: Sequence[SegmentedCurve], fit: FitResult) -> Model:
    functions = {
        f.id: SegmentFunction(
            f.id,
            f.cell,
            f.terms,
            f.selection.theta,
            f.selection.theta_error,
            f.selection.g,
            f.selection.err,
            f.scaling,
            f.selection.samples,
            1.0,
            "max_terms",
        )
        for f in fit.segments
    }
    curves = tuple(
        CurveFunction(c.curve, c.level, c.boundaries, c.limits, tuple(functions[s.id] for s in c.segments)) for c in segmentation
    )
    fusion = Fusion(transition="quadratic", extrapolation={"strain": ("continue", "continue"), "pressure": ("continue", "continue_linear")})
    return Model(name, QUANTITIES["force"], (QUANTITIES["pressure"], QUANTITIES["strain"]), Pieces("pressure", ("strain",), curves, fusion))


def _formula(name: str, failed: bool) -> FormulaFit:
    if failed:
        return FormulaFit(
            name, {"a1": np.nan}, {"a1": np.nan}, "failed", "levenberg_marquardt", 0, np.nan, np.nan, 600, ("the solver found no step",)
        )
    return FormulaFit(
        name,
        {"a1": 0.6, "a2": -9.5, "a3": 2.3},
        {"a1": 0.01, "a2": np.nan, "a3": 0.02},
        "converged",
        "variable projection",
        3,
        812.0,
        5.0,
        600,
    )


def _scores(curves: Sequence[Curve], predictions: Mapping[str, Sequence[np.ndarray]]):
    def score(model: str, split: str, name: str, chosen: Sequence[tuple[int, np.ndarray]]) -> Score:
        y = np.concatenate([curves[i].columns["force"][rows] for i, rows in chosen])
        error = np.concatenate([predictions[model][i][rows] for i, rows in chosen]) - y
        rmse, top, worst = float(np.sqrt(np.mean(error**2))), float(np.abs(y).max()), float(np.abs(error).max())
        r2 = 1 - float(np.sum(error**2) / np.sum((y - y.mean()) ** 2))
        return Score(model, "force", split, name, len(y), rmse, rmse / top, top, f"max|force| over {split}", worst, worst / top, r2)

    for split in ("train", "validate"):
        rows = {i: c.held_out == (split == "validate") for i, c in enumerate(curves)}
        some = [(i, mask) for i, mask in rows.items() if mask.any()]
        for model in predictions if some else ():
            yield score(model, split, "all", some)
            for i, mask in some:
                yield score(model, split, curves[i].id, [(i, mask)])


def of_pieces(model: Model, **changes: Any) -> Model:
    """The model with other pieces."""
    return replace(model, body=replace(model.body, **changes))
