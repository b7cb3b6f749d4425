"""Models with memory: delays, slow states, hysteresis operators and resonances as candidates of one
regression.
"""

from mapmore_cli.domain.fits import MemoryFit
from mapmore_cli.domain.models import Memory
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("memory", Memory, MemoryFit, __name__, over_time=True)
