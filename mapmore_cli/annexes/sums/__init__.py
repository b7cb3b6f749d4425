"""Models that are added up, as a static and a damping model (M2 section 3)."""

from mapmore_cli.annexes.sums.body import Sum
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("sum", Sum, None, __name__, fitted=f"{__name__}.fitted")
