"""Model several outputs that share their segments and terms. There is one model for each output,
and one model that contains them.
"""

from mapmore_cli.domain.models import Outputs
from mapmore_cli.domain.results import OutputsFit
from mapmore_cli.modelling.kinds import Kind, Verbs


def _verbs() -> Verbs:
    from mapmore_cli.modelling.outputs.model import OutputsVerbs

    return OutputsVerbs()


KIND = Kind("outputs", Outputs, OutputsFit, _verbs)
