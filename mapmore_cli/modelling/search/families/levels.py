"""A function of each level, or of what a formula leaves there, and interpolation between levels."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Family
from mapmore_cli.modelling.search.families.formula import fitting
from mapmore_cli.modelling.search.situation import Situation


def candidates(of: Situation) -> Iterator[Candidate]:
    """Three segments of the input that is swept."""
    swept = of.inputs[0]
    for backbone in (None, *fitting(of, ("sarosi_hinged",))):
        model = {} if backbone is None else {"model": {"backbone": backbone}}
        sections = {
            "segment": {swept: {"method": "even", "count": 3, "min_samples": 6}},
            **model,
            "dictionary": [{"polynomial": {"of": [swept], "order": 3}}],
            "fit": {"max_terms": 3, "stop": "bic"},
        }
        yield Candidate(f"levels, 3 segments of {swept}{f' on {backbone}' if backbone else ''}", {**sections, "fuse.levels": "pchip"})


FAMILY = Family(lambda of: of.level is not None and len(of.inputs) == 2 and of.curves > 1, candidates, of_few_levels=None)
