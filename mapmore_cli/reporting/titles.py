"""Names of models as people write them."""

from __future__ import annotations

from functools import lru_cache

from mapmore_cli.domain.scores import BASELINES, SIMPLE
from mapmore_cli.modelling import literature

OTHERS = {**BASELINES, **SIMPLE}


@lru_cache(maxsize=10_000)
def title_of(text: str) -> str:
    """Return the title of the model or of the sum of models that a text names, `sarosi_hinged` as `Sárosi, hinged`; else the text."""
    found = [_declared(name) for name in text.split("+")]
    return text if "" in found else " + ".join(found)


def _declared(name: str) -> str:
    """Return the declared title; nothing where there is none."""
    return OTHERS.get(name) or (literature.get(name).title if name in literature.names() else "")
