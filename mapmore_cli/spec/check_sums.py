"""Checks of sums: their inputs are those of the parts, expressions of the study's quantities, and two quantities never share a name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.check_names import expression_findings
from mapmore_cli.spec.diagnostics import Finding, did_you_mean
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.method import Summand
from mapmore_cli.spec.sections.results import Competitor
from mapmore_cli.spec.tree import Loc


def sums(spec: ExperimentSpec) -> Iterator[Finding]:
    """Every sum of a study: its own, and those that it is compared with."""
    if spec.model.sum is not None:
        yield from _sum(spec, spec.model.sum, ("model", "sum"))
    for i, competitor in enumerate(spec.validation.against):
        if isinstance(competitor, Competitor) and competitor.sum is not None:
            yield from _sum(spec, competitor.sum, ("validate", "against", i, "sum"))


def _sum(spec: ExperimentSpec, parts: Sequence[Summand], loc: Loc) -> Iterator[Finding]:
    from mapmore_cli.modelling import literature
    from mapmore_cli.modelling.sums.build import refuse_shared_names

    known = []
    for i, part in enumerate(parts):
        for name, text in part.inputs.items():
            yield from expression_findings(text, (*loc, i, "inputs", name), spec.quantities)
        if part.formula is None:
            continue
        if part.formula not in literature.names():
            remedy = did_you_mean(part.formula, literature.names())
            yield Finding((*loc, i, "formula"), f"there is no literature model `{part.formula}`", remedy)
            continue
        inputs = literature.get(part.formula).inputs
        known.append((f"{part.formula} ({i + 1})", inputs, part.inputs))
        for name in part.inputs:
            if name not in inputs:
                yield Finding((*loc, i, "inputs", name), f"`{part.formula}` has no input `{name}`", did_you_mean(name, inputs), on_key=True)
        for name in inputs:
            if name not in part.inputs and name not in spec.quantities:
                remedy = f"say what it is here, as `inputs: {{{name}: my_{name}}}`"
                yield Finding((*loc, i, "formula"), f"`{part.formula}` needs the quantity `{name}`", remedy)
    try:
        refuse_shared_names(known)
    except SpecError as error:
        yield Finding(loc, error.message, error.remedy)
