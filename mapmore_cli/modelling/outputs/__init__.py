"""Model several outputs with the same segments and the same terms. Each output has its own model,
and one further model contains all of them.
"""

from mapmore_cli.domain.models import Outputs
from mapmore_cli.domain.results import OutputsFit
from mapmore_cli.modelling.kinds import Kind, Verbs


def _verbs() -> Verbs:
    from mapmore_cli.modelling.outputs.model import OutputsVerbs

    return OutputsVerbs()


KIND = Kind("outputs", Outputs, OutputsFit, _verbs)
