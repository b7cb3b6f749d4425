"""Write what people look at: `report/index.html`, its figures and tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mapmore_cli.spec.experiment import ExperimentSpec, Muscle
from mapmore_cli.spec.sections.results import Report, Validate
from mapmore_cli.stages.pipeline.stage import Stage, Workspace

if TYPE_CHECKING:
    from mapmore_cli.domain.models import Equation, Model


@dataclass(frozen=True)
class Slice:
    """What the report shows beyond the results: everything else in the resolved spec makes an earlier stage stale."""

    name: str
    muscle: Muscle
    validate: Validate
    report: Report


def reads(spec: ExperimentSpec) -> Slice:
    """The stage's slice of the spec."""
    return Slice(spec.name, spec.muscle, spec.validation, spec.report)


def run(part: Slice, workspace: Workspace) -> None:
    """Collect the results of the run and write the page."""
    from mapmore_cli.modelling.equations import model_equations
    from mapmore_cli.reporting.inputs import Published, ReportInputs
    from mapmore_cli.reporting.report import write_report
    from mapmore_cli.storage import artefacts
    from mapmore_cli.storage.provenance import tool_versions

    folder = workspace.run_dir
    dataset = artefacts.read_dataset(folder / "ingest.h5")
    model = artefacts.read_model(folder / "model.h5")
    published = part.report.published
    write_report(
        ReportInputs(
            name=part.name,
            muscle=_labels(part.muscle),
            target=dataset.quantities[dataset.target],
            dataset=dataset,
            segmentation=artefacts.read_segmentation(folder / "segment.h5"),
            fit=artefacts.read_fit(folder / "fit.h5"),
            model=model,
            validation=artefacts.read_validation(folder / "validate.h5"),
            equations=model_equations(model),
            other_equations=_in_units(model, part.report.units),
            published=Published(published.source, published.nrmse, published.rmse) if published else None,
            spec_text=(folder / "experiment.yaml").read_text(encoding="utf-8"),
            provenance=tool_versions(),
            notes=(*dataset.notes, *model.notes),
        ),
        workspace.out / "report",
        part.report.figures,
        part.report.formats,
    )


def _in_units(model: Model, units: Mapping[str, str]) -> dict[str, tuple[Equation, ...]]:
    """The equations in other units of some quantities, and of the rates that follow from these."""
    from mapmore_cli.modelling.equations import model_equations
    from mapmore_cli.spec.units import convert, default_unit

    if not units:
        return {}
    rates = {signal.name: signal.of for signal in model.signals if signal.kind == "rate"}
    known = {**{quantity.name: quantity.unit for quantity in model.inputs if quantity.name not in rates}, **units}
    named = {quantity.name: default_unit(quantity.name, known, rates) for quantity in model.inputs}
    factors = {quantity.name: convert(1.0, named[quantity.name], quantity.unit) for quantity in model.inputs}
    changed = {quantity.name: factors[quantity.name] for quantity in model.inputs if named[quantity.name] != quantity.unit}
    words = ", ".join(f"{name} in {named[name]}" for name in changed)
    return {words: model_equations(model, changed)} if changed else {}


def _labels(muscle: Muscle) -> dict[str, str]:
    words = {"name": muscle.name, "kind": muscle.kind}
    return {
        **{key: word for key, word in words.items() if word is not None},
        **{key: f"{value * 1000:g} mm" for key, value in muscle.lengths.items() if value is not None},
    }


STAGE = Stage(name="report", revision=2, outputs=("report",), reads=reads, run=run)
