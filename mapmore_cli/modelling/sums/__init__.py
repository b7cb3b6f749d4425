"""Models that are added up, as a static and a damping model (M2 section 3)."""

from mapmore_cli.domain.models import Sum
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("sum", Sum, None, "sums")
