"""Model a muscle in series with a tendon. The force stretches the tendon, and the length of the
muscle is the total length minus the length of the tendon.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from mapmore_cli.domain.arrays import Number
from mapmore_cli.domain.models import Body, Model
from mapmore_cli.modelling.kinds import Kind, Verbs


@dataclass(frozen=True)
class Tendon(Body):
    """A model of a muscle in series with a tendon. The inputs `length` and `velocity` of the model
    are the length and the velocity of muscle and tendon together.
    """

    muscle: Annotated[Model, "the muscle alone"]
    stiffness: Annotated[
        Number, "stiffness of the tendon, in the unit of the force divided by that of the length"
    ]
    force: Annotated[Number, "force at which `length` equals the length of the muscle itself"] = 0.0

    @property
    def models(self) -> tuple[Model, ...]:
        """The model of the muscle."""
        return (self.muscle,)


def _verbs() -> Verbs:
    from mapmore_cli.modelling.tendon.model import TendonVerbs

    return TendonVerbs()


KIND = Kind("tendon", Tendon, None, _verbs, over_time=True)
