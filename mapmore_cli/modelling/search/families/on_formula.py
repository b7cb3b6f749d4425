"""A formula, and one smooth surface for what it leaves."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Family, surface
from mapmore_cli.modelling.search.families.formula import fitting
from mapmore_cli.modelling.search.families.surface import polynomial
from mapmore_cli.modelling.search.situation import Situation

BACKBONES = ("sarosi_hinged", "sarosi", "muscle_like")


def candidates(of: Situation) -> Iterator[Candidate]:
    """Yield a surface of order 3 on each formula whose quantities are there."""
    for name in fitting(of, BACKBONES):
        yield surface(f"surface of order 3 on {name}", of, polynomial(of, 3), 8, backbone=name)


FAMILY = Family(lambda of: any(fitting(of, BACKBONES)), candidates)
