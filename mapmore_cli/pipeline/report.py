"""Write the report of a run: `report/index.html`, its figures and its tables."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mapmore_cli.domain.errors import DataError, SpecError, UsageError, Warn
from mapmore_cli.fitting.stage import Stage, Workspace
from mapmore_cli.storage.run_folder import VALIDATION, RunFiles
from mapmore_cli.study.experiment import ExperimentSpec, Muscle
from mapmore_cli.study.sections.model import Needs, OwnFormula
from mapmore_cli.study.sections.report import Report
from mapmore_cli.study.sections.results import Validate

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import SegmentedCurve
    from mapmore_cli.domain.models import Equation, Model
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.domain.results import FitResult, Validation
    from mapmore_cli.reporting.inputs import FigureStyle, ReportInputs

METRES_PER_INCH = 0.0254

LEFT_OUT = (
    "Every {0} is left out in turn. The validation scores are those at the {0} that is left out, "
    "of models that were fitted to the other {0}s. The saved model and the training scores use "
    "all data."
)


@dataclass(frozen=True)
class ReportSlice:
    """Part of the spec that the stage `report` reads. If a change in it, for example of the style
    of figures, has no effect on the results, only this stage is repeated. Settings on which the
    results depend are also in the parts that the earlier stages read.
    """

    name: str
    muscle: Muscle
    validate: Validate
    report: Report
    # `level` if cross-validation leaves out one level after the other, `group` if it leaves out
    # one group after the other; empty without cross-validation
    left_out: str
    unconfirmed: tuple[str, ...]
    # the page shows these sections, although the results may not depend on all of their keys
    units: Mapping[str, str]
    needs: Needs
    formulas: Sequence[str | OwnFormula]


def report_slice(spec: ExperimentSpec) -> ReportSlice:
    """Return the part of the spec on which the stage `report` depends."""
    split = spec.data.split
    left_out = (
        "level" if split.leave_one_level_out else "group" if split.leave_one_group_out else ""
    )
    return ReportSlice(
        spec.name,
        spec.muscle,
        spec.validation,
        spec.report,
        left_out,
        spec.unconfirmed,
        spec.units,
        spec.needs,
        spec.formulas,
    )


def write_pages(part: ReportSlice, workspace: Workspace) -> None:
    """Collect the results of the run and write its page. If there was a structure search, the page
    also shows all structures that were tried.
    """
    from mapmore_cli.reporting.report import write_report

    inputs, *others = collected(part, workspace.run_dir, workspace.spec_text)
    inputs = replace(
        inputs,
        search=RunFiles(workspace.run_dir).search() if workspace.searched else None,
        **provenance_of(workspace.run_dir),
    )
    for warning in faults_of(inputs.style):
        workspace.warn(warning)
    out, wanted = workspace.out / "report", part.report
    write_report(inputs, out, wanted.figures, wanted.formats, others)


def provenance_of(run_dir: Path) -> dict[str, Any]:
    """Return information about the origin of the results, from the record of the run: the command
    that repeats the run, the versions of the tools, and the hashes of the recordings. The command
    must be entered in the folder that contains the folder of runs. Times are left out, so that
    repeating a run gives a page with the same bytes; they are stored in `run.json` only.
    """
    from mapmore_cli.storage.run_record import load_origin, load_records, tool_versions

    records, origin = load_records(run_dir), load_origin(run_dir)
    provenance: dict[str, Any] = {**tool_versions()}
    inputs = {path: stamp for record in records.values() for path, stamp in record.inputs.items()}
    for number, (path, stamp) in enumerate(inputs.items()):
        if number == MOST_HASHES:
            provenance["and"] = f"{len(inputs) - number} more, in run.json"
            break
        provenance[f"SHA-256 of {path}"] = stamp.sha256
    command = ""
    if origin is not None:
        here = run_dir.absolute().parent.parent
        spec = Path(os.path.relpath(run_dir.absolute() / origin.spec, here)).as_posix()
        runs = run_dir.absolute().parent.name
        words = ["mapmore", "run", spec, *([] if runs == "runs" else ["--runs", runs])]
        words += [word for setting in origin.settings for word in ("--set", setting)]
        command = shlex.join(words)
    return {"provenance": provenance, "command": command}


MOST_HASHES = 40
"""Largest number of recordings whose hashes are on the page."""


def collected(part: ReportSlice, run_dir: Path, spec_text: str = "") -> tuple[ReportInputs, ...]:
    """Return, for each output of the model, its results of the earlier stages together with the
    report settings of the spec.
    """
    files = RunFiles(run_dir)
    results = (files.dataset(), files.model(), files.fit(), files.validation())
    outputs = list(zip(*(result.each for result in results), strict=True))
    inputs = [_collected(part, run_dir, files.segmentation(), *output) for output in outputs]
    first, *others = [
        replace(output, prefix=f"{output.target.name}." if len(outputs) > 1 else "")
        for output in inputs
    ]
    return (replace(first, spec_text=spec_text), *others)


def _collected(
    part: ReportSlice,
    run_dir: Path,
    segmentation: tuple[SegmentedCurve, ...],
    dataset: Dataset,
    model: Model,
    fit: FitResult,
    validation: Validation,
) -> ReportInputs:
    from mapmore_cli.checking.findings import sentences
    from mapmore_cli.modelling.kinds import equations as model_equations
    from mapmore_cli.modelling.shape.violations import known_shape
    from mapmore_cli.reporting.inputs import FigureStyle, ReportInputs
    from mapmore_cli.storage.run_record import tool_versions

    style, published = part.report.style, part.report.published
    turned = part.validate.as_
    if turned is not None:
        dataset = replace(dataset, target=turned)
    lengths = {key: f"{x * 1000:g} mm" for key, x in part.muscle.lengths.items() if x is not None}
    muscle = {"name": part.muscle.name, "kind": part.muscle.kind, **lengths}
    notes = [LEFT_OUT.format(part.left_out)] if part.left_out else []
    if turned is not None:
        notes.append(
            f"The model predicts {model.output.name}; it is inverted, and scored as {turned}."
        )
    return ReportInputs(
        name=part.name,
        muscle={key: word for key, word in muscle.items() if word is not None},
        whole=dataset,
        segmentation=segmentation,
        fit=fit,
        model=model,
        validation=validation,
        equations=model_equations(model),
        other_equations=_in_units(model, part.report.units),
        published=published.numbers if published else None,
        spec_text="",
        provenance=tool_versions(),
        unconfirmed=part.unconfirmed,
        doubts=sentences(run_dir),
        notes=tuple(notes),
        explore=part.report.explore,
        as_recorded=part.report.over == "time" and "time" in dataset.quantities,
        violations=known_shape(part.muscle.kind, model, dataset.curves),
        style=FigureStyle(
            style.width / METRES_PER_INCH,
            style.font,
            style.size,
            style.labels,
            tuple(style.palette),
        ),
    )


def faults_of(style: FigureStyle) -> list[str]:
    """Return a warning if the font of the figures is not installed on this machine. Raises
    SpecError if a label contains a formula that cannot be typeset.
    """
    if style.font is None and not style.labels:
        return []
    from mapmore_cli.reporting.figures.style import has_font, wrong_formula

    for quantity, label in style.labels.items():
        if fault := wrong_formula(label):
            remedy = "correct the formula between the dollar signs, or remove the dollar signs"
            raise SpecError(
                f"report.style.labels.{quantity}: {label!r} cannot be typeset ({fault})", remedy
            )
    if style.font is not None and not has_font(style.font):
        return [
            (
                f"report.style.font: {style.font!r} is not installed here, so that PDF and PNG "
                "figures use another font"
            )
        ]
    return []


LOOKS = "report.style."
"""Prefix of the keys in a run's spec that may have other values when its results are drawn again.
"""


def drawn_figure(
    run_dir: Path,
    name: str,
    key: str | None,
    suffix: str,
    warn: Warn,
    looks: Sequence[str] = (),
    models: Sequence[str] = (),
) -> tuple[bytes, str | None]:
    """Draw a figure of a run, and return the contents of an image file. If `key` is None, the whole
    figure is drawn. Otherwise, only the panel of the curve or model `key` is drawn, and its numbers
    are returned as CSV too.

    - `name`: name of the figure, such as `fit`; with several outputs, preceded by the output, such
      as `tip_x.fit`.
    - `suffix`: format of the file.
    - `warn`: function that is called if the font of the figures is not installed on this machine.
    - `looks`: settings that replace settings of the run's spec, such as `report.style.width=120
      mm`.
    - `models`: competitors that are drawn; all of them if empty.

    Raises DataError if the folder holds no finished run, or if a part of its results is out of
    date; UsageError for an unknown figure or panel (the message names the known ones), or if
    `looks` has other settings than `report.style`.
    """
    from mapmore_cli.reporting.figures.drawing import compose, drawings, panel_of, to_bytes
    from mapmore_cli.reporting.figures.style import figure_style
    from mapmore_cli.reporting.order import FIGURES
    from mapmore_cli.reporting.report import data_csv
    from mapmore_cli.storage.run_record import refuse_stale
    from mapmore_cli.study.loader import load

    if not (run_dir / VALIDATION).is_file():
        raise DataError(
            f"{run_dir}: does not contain a finished run",
            "give a folder that `mapmore run` wrote, for example runs/NAME",
        )
    refuse_stale(run_dir)
    if other := next((look for look in looks if not look.startswith(LOOKS)), None):
        raise UsageError(
            f"--set {other}: this key changes more than the look of a figure",
            f"set a key of {LOOKS.rstrip('.')}, or change the spec and repeat the run",
        )
    every = collected(report_slice(load(run_dir / "experiment.yaml", looks).spec), run_dir)
    prefix, name = name[: name.rfind(".") + 1], name.rpartition(".")[2]
    inputs = next((output for output in every if output.prefix == prefix), None)
    if inputs is None:
        known = ", ".join(f"{output.prefix}{name}" for output in every)
        raise UsageError(f"{run_dir}: has no figure {prefix}{name}", f"choose one of {known}")
    for warning in faults_of(inputs.style):
        warn(warning)
    inputs = inputs.beside(models) if models else inputs
    with figure_style(inputs.style):
        drawing, panel = (
            (next(iter(drawings(name, inputs)), None), None)
            if key is None
            else panel_of(name, inputs, key)
        )
        if drawing is None:
            known = ", ".join(prefix + other for other in FIGURES if drawings(other, inputs))
            raise UsageError(
                f"{run_dir}: its results contain nothing to draw as {prefix}{name}",
                f"choose one of {known}",
            )
        as_wide = any(look.startswith(f"{LOOKS}width=") for look in looks)
        figure = compose(drawing, inputs.style, panel, inputs.style.width if as_wide else None)
        written = to_bytes(figure, suffix, drawing.name, drawing.alt)
        return written, None if panel is None else data_csv(panel.data)


def _in_units(model: Model, units: Mapping[str, str]) -> dict[str, tuple[Equation, ...]]:
    """Return the equations of the model in other units: `units` gives the unit of some quantities,
    and also changes the units of their rates. The result is empty if `units` is empty.
    """
    from mapmore_cli.modelling.kinds import equations as model_equations
    from mapmore_cli.study.units import convert, default_unit

    if not units:
        return {}
    rates = {signal.name: signal.of for signal in model.signals if signal.kind == "rate"}
    known = {
        quantity.name: quantity.unit for quantity in model.inputs if quantity.name not in rates
    }
    known |= units
    factors, words = dict[str, float](), list[str]()
    for quantity in model.inputs:
        unit = default_unit(quantity.name, known, rates)
        if unit != quantity.unit:
            factors[quantity.name] = convert(1.0, unit, quantity.unit)
            words.append(f"{quantity.name} in {unit}")
    return {", ".join(words): model_equations(model, factors)} if factors else {}


STAGE = Stage(name="report", revision=15, outputs=("report",), reads=report_slice, run=write_pages)
