"""Implement the MAPMORE method of the papers M1 and M2 (docs/references.md). Curves are cut into
segments, a few terms are chosen for each segment, and the pieces are fused with smooth weights.
"""

from mapmore_cli.domain.models import Pieces
from mapmore_cli.domain.results import PiecesFit
from mapmore_cli.modelling.kinds import Kind, Verbs


def _verbs() -> Verbs:
    from mapmore_cli.modelling.pieces.model import PiecesVerbs

    return PiecesVerbs()


KIND = Kind("pieces", Pieces, PiecesFit, _verbs)
