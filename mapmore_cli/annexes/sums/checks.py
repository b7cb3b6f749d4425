"""Check the spec of a sum."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mapmore_cli.annexes.sums.joint import refuse_shared_names
from mapmore_cli.study.checks.competitors import formula_called, rivals_of, unknown_formula
from mapmore_cli.study.checks.terms import expression_findings
from mapmore_cli.study.diagnostics import Finding, did_you_mean, refused
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.model import Summand
from mapmore_cli.study.tree import Loc


def findings(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check every sum of a study: the model of the study and its competitors."""
    of_model: tuple[Loc, Sequence[Summand] | None] = (("model",), spec.model.sum)
    for loc, parts in [of_model, *((loc, rival.sum) for loc, rival in rivals_of(spec))]:
        if parts is not None:
            yield from _sum(spec, parts, (*loc, "sum"))


def _sum(spec: ExperimentSpec, parts: Sequence[Summand], loc: Loc) -> Iterator[Finding]:
    known = []
    for i, part in enumerate(parts):
        for name, text in part.inputs.items():
            yield from expression_findings(text, (*loc, i, "inputs", name), spec.quantities)
        formula = formula_called(spec, part.formula)
        if formula is None:
            yield from unknown_formula(spec, part.formula, (*loc, i, "formula"))
            continue
        known.append((f"{part.formula} ({i + 1})", formula.inputs, part.inputs))
        for name in part.inputs:
            if name not in formula.inputs:
                remedy = did_you_mean(name, formula.inputs)
                yield Finding(
                    (*loc, i, "inputs", name),
                    f"`{part.formula}` has no input `{name}`",
                    remedy,
                    on_key=True,
                )
        for name in formula.inputs:
            if name not in part.inputs and name not in spec.quantities:
                remedy = f"assign a quantity of the study to it: `inputs: {{{name}: my_{name}}}`"
                yield Finding(
                    (*loc, i, "formula"), f"`{part.formula}` needs the quantity `{name}`", remedy
                )
    yield from refused(loc, refuse_shared_names, known)
