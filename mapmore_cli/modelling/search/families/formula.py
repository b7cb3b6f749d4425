"""A formula of the literature alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature import TARGET
from mapmore_cli.modelling.search.candidate import Candidate, Family
from mapmore_cli.modelling.search.situation import Situation

FORCE = "force"
"""What formulas of muscles predict."""


def fitting(of: Situation, names: Sequence[str]) -> Iterator[str]:
    """Yield formulas whose quantities are among the inputs, with no dimensions and fewer parameters than there are samples."""
    for name in names:
        formula = literature.get(name)
        known = formula.inputs and {*formula.inputs} <= {*of.inputs}
        of_target = of.target == FORCE and formula.fitted_to == TARGET
        if of_target and known and not formula.dimensions and len(formula.parameters) < of.samples:
            yield name


def candidates(of: Situation) -> Iterator[Candidate]:
    """Every formula that can be fitted."""
    for name in fitting(of, literature.names()):
        yield Candidate(f"formula {name}", {"model": {"type": "literature", "name": name}})


FAMILY = Family(lambda of: any(fitting(of, literature.names())), candidates, of_few_levels=None)
