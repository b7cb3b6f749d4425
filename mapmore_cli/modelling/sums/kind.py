"""Models that are added up."""

from mapmore_cli.domain.models import Sum
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("sum", Sum, None, "sums")
