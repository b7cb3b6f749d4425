"""Fit models with memory. Delayed signals, slow states, hysteresis operators and resonances are
candidate terms of one regression.
"""

from mapmore_cli.domain.fits import MemoryFit
from mapmore_cli.domain.models import Memory
from mapmore_cli.modelling.kinds import Kind, Verbs


def _verbs() -> Verbs:
    from mapmore_cli.modelling.memory.model import MemoryVerbs

    return MemoryVerbs()


KIND = Kind("memory", Memory, MemoryFit, _verbs, over_time=True)
