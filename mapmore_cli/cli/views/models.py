"""Views of what a run is made of: its data, their segments, what was fitted to these, and the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mapmore_cli.cli.console import View, picked
from mapmore_cli.domain.models import Formula, Fusion, Memory, Part, Pieces, StateSpace, Sum
from mapmore_cli.reporting.memory_tables import identified_table, sections_table, sizes_table, states_table, substitutes_table
from mapmore_cli.reporting.model_tables import rival_minima, terms_table
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.reporting.tables import levels_table, recordings_table

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit, Segment, SegmentedCurve, SegmentFit, Selection
    from mapmore_cli.domain.memory import MemoryFit, MemoryModel
    from mapmore_cli.domain.models import CurveFunction, CurveRange, Model, SegmentFunction
    from mapmore_cli.domain.motion import Motion, MotionFit
    from mapmore_cli.domain.recording import Curve, Dataset
    from mapmore_cli.domain.results import FitResult

# Data ---------------------------------------------------------------------------------------------------------------------------------


def of_dataset(dataset: Dataset) -> View:
    """Rows kept and dropped of every recording; the curves with what trains and what validates."""
    document = {
        **picked(dataset, "target", "level"),
        "units": {name: quantity.unit for name, quantity in dataset.quantities.items()},
        "recordings": [picked(one, "id", "source", "rows_read", "rows_kept", "dropped") for one in dataset.recordings],
        "curves": [_curve(curve) for curve in dataset.curves],
        "notes": dataset.notes,
    }
    return View(document, (recordings_table(dataset), levels_table(dataset)), dataset.notes)


def _curve(curve: Curve) -> dict[str, Any]:
    held_out = int(curve.held_out.sum())
    return {"id": curve.id, "level": curve.level, "train": curve.size - held_out, "validate": held_out, "recordings": curve.recordings}


def of_segmentation(curves: Sequence[SegmentedCurve]) -> View:
    """Where every segment lies, and how many samples it has."""
    document = {
        "curves": [
            {
                "id": curve.curve,
                "level": curve.level,
                "boundaries": dict(zip(curve.variables, curve.boundaries, strict=True)),
                "limits": curve.limits,
                "segments": [{"id": segment.id, "cell": segment.cell, "n": len(segment.rows)} for segment in curve.segments],
            }
            for curve in curves
        ]
    }
    variables = tuple(dict.fromkeys(name for curve in curves for name in curve.variables))
    columns = (Column("segment"), Column("samples"), *(Column(f"{name} {end}") for name in variables for end in ("from", "to")))
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (segment.id, len(segment.rows), *(end for name in variables for end in _ends(curve, segment).get(name, (None, None))))
        for curve in curves
        for segment in curve.segments
    )
    return View(document, (Table("segments", "Segments", columns, rows),))


def _ends(curve: SegmentedCurve, segment: Segment) -> dict[str, tuple[float, float]]:
    """From where to where a segment goes along each variable that its curve is cut along."""
    cuts = zip(curve.variables, segment.cell, curve.boundaries, strict=True)
    return {name: (float(locations[place - 1]), float(locations[place])) for name, place, locations in cuts}


# Fits ---------------------------------------------------------------------------------------------------------------------------------


def of_fit(result: FitResult) -> View:
    """Return the segments, or the model with memory, with their terms in the order of selection; theta is in scaled coordinates."""
    document = {
        "segments": [_segment(fit, fit.selection) for fit in result.pieces],
        "memory": _memory_fit(result.memory),
        "motion": _motion_fit(result.motion),
        "backbone": _formula(result.formula),
        "notes": result.notes,
    }
    tables = [terms_table(result)] if result.pieces else []
    tables += _memory_fit_tables(result.memory) if result.memory is not None else ()
    tables += [sections_table({"mapmore": result.motion}, "")] if result.motion is not None else []
    return View(document, tuple(tables), (*_formula_lines(result.formula), *result.notes))


def _segment(named: SegmentFit | SegmentFunction, found: Selection | SegmentFunction) -> dict[str, Any]:
    """One segment function; theta is in scaled coordinates."""
    head = {**picked(named, "id", "terms"), **picked(found, "theta", "theta_error", "g", "err")}
    return {**head, "scaling": asdict(named.scaling), **picked(found, "samples", "stop", "condition")}


def _formula(formula: FormulaFit | None) -> dict[str, Any] | None:
    return None if formula is None else asdict(formula)


def _formula_lines(formula: FormulaFit | None) -> tuple[str, ...]:
    """Its parameters in a line, and other minima that fit nearly as well."""
    from mapmore_cli.modelling.literature.own import units_of_parameters

    if formula is None:
        return ()
    units = units_of_parameters(formula)
    parameters = ", ".join(f"{name} = {value:.6g} {units.get(name, '')}".rstrip() for name, value in formula.parameters.items())
    own = f"{formula.name} ({formula.status.replace('_', ' ')}, {formula.method}): {parameters}"
    return (own, *rival_minima(formula.name, formula))


def _memory_fit(fit: MemoryFit | None) -> dict[str, Any] | None:
    """Return the model as it is stored, with how its terms were found: those chosen forward, and the best substitute of each."""
    if fit is None:
        return None
    return {
        **asdict(fit.model),
        "ridge": fit.ridge,
        "forward": [fit.candidates[place] for place in fit.forward],
        "substitutes": [fit.candidates[place] if place >= 0 else None for place in fit.substitutes],
        **picked(fit, "shares", "held_out"),
        "identified": None if fit.identified is None else asdict(fit.identified),
    }


def _memory_fit_tables(fit: MemoryFit) -> tuple[Table, ...]:
    """Return what else would have served, where a ridge tells; then the tables of the model."""
    identified = (identified_table(fit),) if fit.identified is not None else ()
    substitutes = (substitutes_table(fit),) if len(fit.substitutes) else ()
    sizes = (sizes_table(fit),) if fit.held_out is not None else ()
    return (*identified, *substitutes, *sizes, *_memory_tables(fit.model))


def _memory_tables(memory: MemoryModel) -> tuple[Table, ...]:
    """Coefficients with standard errors, and the numbers behind the states where there are any."""
    columns = (Column("term"), Column("coefficient", "", "#.6g"), Column("standard error", "", ".3g"))
    rows = tuple(zip(memory.terms, memory.theta.tolist(), memory.theta_error.tolist(), strict=True))
    constant = (("(constant)", memory.constant, None),) if memory.constant else ()
    scaled = "Coefficients of scaled states." if memory.states.scaled else "Coefficients in physical units."
    title = f"Coefficients of {memory.output}"
    coefficients = Table("coefficients", title, columns, (*constant, *rows), (scaled,))
    states = states_table(memory.states)
    return (coefficients, states) if states.rows else (coefficients,)


def _memory_line(memory: MemoryModel) -> str:
    """How the model is run."""
    from mapmore_cli.modelling.memory.feedback import fed_back_states

    steps = sorted(fed_back_states(memory.states, memory.output).values())
    first = f"the first {steps[-1]} measured samples" if steps and steps[-1] > 1 else "the first measured sample"
    start = f"from {first} of {memory.output}" if steps else f"without measured {memory.output}"
    return f"Runs free {start}, at steps of {memory.states.step:.6g} s."


def _motion(motion: Motion) -> dict[str, Any]:
    """Return the model as it is stored, with the poles (real and imaginary parts) and the gain of every section."""
    derived = ({"poles": [[pole.real, pole.imag] for pole in section.poles], "gain": section.gain} for section in motion.sections)
    sections = [{**asdict(section), **more} for section, more in zip(motion.sections, derived, strict=True)]
    return {**asdict(motion), "sections": sections}


def _motion_fit(fit: MotionFit | None) -> dict[str, Any] | None:
    """Return the same, with how its sections were found."""
    return None if fit is None else {**_motion(fit.model), "solver": fit.solver, "searches": [asdict(search) for search in fit.searches]}


def _motion_line(motion: Motion) -> str:
    """How the model is run."""
    ways = {
        "hard": "every section runs, the active one's output is taken",
        "carried": "sections hand one state on",
        "bumpless": "sections share one state, and meet at their boundaries",
    }
    at = ", ".join(f"{boundary:g}" for boundary in motion.boundaries)
    places = f"Sections meet at {motion.input} {at}. " if at else ""
    return f"{places}Switching: {motion.switching} ({ways[motion.switching]}), at steps of {motion.step:.6g} s, from {motion.start}."


# Models -------------------------------------------------------------------------------------------------------------------------------


def of_model(model: Model) -> View:
    """Return the inputs, what the kind has to show, and the equations; weights, limits and equations are in physical units."""
    from mapmore_cli.modelling.kinds import equations

    found = equations(model)
    inputs = ", ".join(f"{quantity.name} [{quantity.unit}]" for quantity in model.inputs) or "its own past"
    title = f"{model.name}: {model.output.name} [{model.output.unit}] from {inputs}"
    table = Table("equations", title, (Column("piece"), Column("equation")), tuple((one.id, one.text) for one in found))
    shown = _shown(model)
    document = {**_document(model, shown), "equations": [asdict(one) for one in found]}
    return View(document, (table, *shown.tables), (*shown.lines, *model.notes))


def _document(model: Model, shown: View) -> dict[str, Any]:
    head = {"name": model.name, "output": asdict(model.output), "inputs": [asdict(quantity) for quantity in model.inputs]}
    return {**head, **shown.document, "notes": model.notes}


def _shown(model: Model) -> View:
    """Return what a kind shows beside the equations; one that has nothing of its own to show is shown as it is stored."""
    from mapmore_cli.modelling.kinds import kind_of

    document: dict[str, Any]
    tables: tuple[Table, ...] = ()
    lines: tuple[str, ...] = ()
    match model.body:
        case Pieces() as body:
            document = {
                "level": body.level,
                "segments": [_segment(segment, segment) for segment in body.segments],
                "backbone": _formula(body.backbone),
                "cross_validation": [asdict(error) for error in body.cross_validation],
                "weights": _weights(body),
                "limits": _limits(body.ranges),
            }
            lines = (_fusion_line(body.fusion),)
        case Formula() as body:
            document = {"level": body.level, "formula": _formula(body.fit), "limits": _limits(body.ranges)}
            lines = _formula_lines(body.fit)
        case Memory() as body:
            document = {"memory": asdict(body.model), "backbone": _formula(body.backbone), "limits": _limits(body.ranges)}
            tables, lines = _memory_tables(body.model), (_memory_line(body.model),)
        case StateSpace() as body:
            document = {"motion": _motion(body.motion), "limits": _limits(body.ranges)}
            lines = (_motion_line(body.motion),)
        case Sum() as body:
            document = {"parts": [_part(part) for part in body.parts]}
            shown = [(one.name, _shown(one)) for part in body.parts for one in part.models]
            tables = tuple(table for _, view in shown for table in view.tables)
            lines = tuple(f"{name}: {line}" for name, view in shown for line in view.lines)
        case _:
            document = asdict(model.body)  # type: ignore[call-overload]
    return View({"kind": kind_of(model).name, **document}, tables, lines)


def _part(part: Part) -> dict[str, Any]:
    fed = {"fed": [_part(one) for one in part.fed]} if part.fed else {}
    return {"sign": part.sign, "renamed": part.inputs, **fed, **_document(part.model, _shown(part.model))}


def _limits(ranges: tuple[CurveRange, ...]) -> dict[str, Any]:
    return {one.curve: one.limits for one in ranges}


def _weights(pieces: Pieces) -> dict[str, Any]:
    return {
        **picked(pieces.fusion, "transition", "z_s", "extrapolation"),
        "levels": [curve.level for curve in pieces.curves if curve.level is not None],
        **picked(pieces.fusion, "between_levels=levels", "aligned"),
        "thresholds": {curve.curve: curve.threshold for curve in pieces.curves if curve.threshold is not None},
        "shrink": pieces.fusion.shrink,
        "curves": [_curve_weights(pieces, curve) for curve in pieces.curves],
    }


def _curve_weights(pieces: Pieces, curve: CurveFunction) -> dict[str, Any]:
    """Boundaries of the segments, and start and end of the transition zone at each inner one (M2 eq 10-11)."""
    from mapmore_cli.modelling.pieces.definition import zones

    boundaries = dict(zip(pieces.variables, curve.boundaries, strict=True))
    at = {name: [list(zone) for zone in zip(*zones(ends, pieces.fusion.z_s), strict=True)] for name, ends in boundaries.items()}
    return {"id": curve.curve, "level": curve.level, "boundaries": boundaries, "zones": at}


def _fusion_line(fusion: Fusion) -> str:
    sides = "; ".join(f"{name}: {below} below, {above} above" for name, (below, above) in fusion.extrapolation.items())
    between = fusion.levels + (f", aligned at the threshold along {fusion.aligned}" if fusion.aligned else "")
    carried = f", {fusion.shrink:.0%} of the residual midway" if fusion.shrink < 1 else ""
    return f"Transition: {fusion.transition}, z_s = {fusion.z_s:g}. Between levels: {between}{carried}. Extrapolation: {sides}."
