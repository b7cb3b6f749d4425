"""Check that every quantity that a spec names exists."""

from __future__ import annotations

import graphlib
from collections.abc import Collection, Iterator, Mapping
from typing import get_args

from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.study.checks.remedies import NO_TIME, unknown_quantity
from mapmore_cli.study.checks.terms import expression_findings
from mapmore_cli.study.diagnostics import Finding, applying, did_you_mean
from mapmore_cli.study.experiment import ExperimentSpec, TargetColumn
from mapmore_cli.study.fields import TargetKind
from mapmore_cli.study.sections.data import Rate
from mapmore_cli.study.sections.dictionary import names_in
from mapmore_cli.study.tree import Loc, values_at
from mapmore_cli.study.units import is_quantity

NAMED = (
    *("data.derive.*.rate_of", "data.derive.*.direction_of", "data.keep.*.quantity"),
    *("data.files.*.keep.*.quantity", "data.uncertainty.*", "data.cycles.over", "data.levels.of"),
    *("data.split.validate.of", "segment.*.of", "validate.as"),
)
"""Places of a spec at which a text is the name of a quantity of the study, unless it is a number
with a unit.
"""


def names_of_quantities(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that every quantity that the spec uses is a quantity of the study."""
    if isinstance(spec.target, TargetColumn) and spec.target.column not in spec.quantities:
        target, known = spec.target.column, (*spec.quantities, *get_args(TargetKind))
        fault = (
            f"there is no quantity `{target}` in this study, and no kind of target has this name"
        )
        yield Finding(("target", "column"), fault, did_you_mean(target, known))
    whole = spec.model_dump(by_alias=True)
    for place in NAMED:
        for loc, name in values_at(whole, place):
            if isinstance(name, str) and not is_quantity(name):
                yield from unknown_quantity(name, spec.quantities, loc)
    hold_out, beyond = spec.data.split.hold_out, spec.fuse.extrapolation
    # `direction: none` cancels an inherited cut by direction; `direction` is then no quantity
    cut = [name for name, how in spec.segment.items() if (name, how) != (DIRECTION, "none")]
    keys: list[tuple[Loc, Collection[str]]] = [
        (("data", "uncertainty"), spec.data.uncertainty),
        (("data", "split", "validate"), hold_out.quantities if hold_out is not None else ()),
        (("segment",), cut),
        (("fuse", "extrapolation"), beyond if isinstance(beyond, Mapping) else ()),
    ]
    for around, names in keys:
        for name in names:
            yield from unknown_quantity(name, spec.quantities, (*around, name), on_key=True)


def derivations(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that derived quantities have names of their own, can be computed, and do not depend on
    themselves.
    """
    needs: dict[str, set[str]] = {}
    for name, rule in spec.data.derive.items():
        loc, is_rate = ("data", "derive", name), isinstance(rule, Rate)
        yield from applying(
            (
                name in spec.data.measured,
                "data.derive.{name}:",
                "`{name}` is both a column and a derived quantity",
                "give one of the two another name",
            ),
            (
                is_rate and "time" not in spec.data.quantities,
                "data.derive.{name}:",
                "the rate `{name}` needs the time",
                NO_TIME,
            ),
            name=name,
        )
        if isinstance(rule, str):
            needs[name] = {*names_in(rule)}
            yield from expression_findings(rule, loc, spec.quantities)
        else:
            needs[name] = {rule.source}
    try:
        graphlib.TopologicalSorter(needs).prepare()
    except graphlib.CycleError as error:
        circle = [str(name) for name in error.args[1]]
        fault = f"these derived quantities depend on each other in a circle: {' <- '.join(circle)}"
        yield Finding(("data", "derive", circle[0]), fault, "break the circle", on_key=True)
