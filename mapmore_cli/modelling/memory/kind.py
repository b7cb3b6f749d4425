"""One model with memory of whole recordings."""

from mapmore_cli.domain.fits import MemoryFit
from mapmore_cli.domain.models import Memory
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("memory", Memory, MemoryFit, "memory")
