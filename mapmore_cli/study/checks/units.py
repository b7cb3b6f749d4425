"""Check the metrics, and the units in which results are given."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.domain.scores import METRICS, OF_TARGET
from mapmore_cli.study.checks.remedies import unknown_quantity
from mapmore_cli.study.diagnostics import Finding, did_you_mean, refused
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.logs import Logs
from mapmore_cli.study.tree import Loc
from mapmore_cli.study.units import CANONICAL, check_unit, convert, default_unit, is_canonical


def metrics(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check the metrics in `validate.require`: they must be metrics of the score table. With
    several targets, a metric in the unit of a target needs a limit for each target.
    """
    targets = {*spec.targets} if spec.also else set[str]()
    for name, limit in spec.validation.require.items():
        loc = ("validate", "require", name)
        named = {*limit} if isinstance(limit, dict) else set[str]()
        if name not in METRICS:
            fault = f"there is no metric `{name}`"
            yield Finding(loc, fault, did_you_mean(name, METRICS), on_key=True)
        elif named - targets or (targets and not named and name in OF_TARGET):
            fault = (
                f"the limit of `{name}` must be a number, or a number for each of several targets"
            )
            yield Finding(loc, fault, f"write `{name}: 1`, or `{name}: {{tip_x: 1, tip_y: 2}}`")


def units(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that every unit exists and has the right dimension. A quantity with a fixed meaning,
    such as `pressure`, must have a unit of its dimension in the model. It must be possible to
    convert the unit of a column to the unit of its quantity in the model.
    """
    known, wrong = (*spec.data.quantities, *CANONICAL), set[str]()
    for name, unit in spec.units.items():
        yield from unknown_quantity(name, known, ("units", name), on_key=True)
        for finding in _unit_findings(
            ("units", name), unit, default_unit(name) if is_canonical(name) else unit
        ):
            wrong.add(name)
            yield finding
    for name, unit in spec.report.units.items():
        in_model = default_unit(name, spec.units)
        faults = _unit_findings(("report", "units", name), unit, in_model)
        yield from faults
        if not faults and name not in wrong and convert(0.0, unit, in_model) != 0:
            yield Finding(
                ("report", "units", name),
                f"the zero of `{unit}` differs from the zero of `{in_model}`, but equations can "
                "only be converted to another unit by a factor",
                f"use one unit in the whole study: `units: {{{name}: {unit}}}`",
            )
    tables: list[tuple[Loc, Logs]] = [(("data",), spec.data)]
    tables += [(("data", "join", i), join) for i, join in enumerate(spec.data.join)]
    for loc, table in tables:
        for name, column in table.columns.items():
            if column.unit is not None and name not in wrong:
                place = (*loc, "columns", name, "unit")
                yield from _unit_findings(place, column.unit, default_unit(name, spec.units))


def _unit_findings(loc: Loc, unit: str, wanted: str) -> list[Finding]:
    return [*refused(loc, check_unit, unit)] or [*refused(loc, convert, 0.0, unit, wanted)]
