"""Several outputs that share their segments and terms: a model for each, in one."""

from mapmore_cli.domain.models import Outputs
from mapmore_cli.domain.results import OutputsFit
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("outputs", Outputs, OutputsFit, __name__)
