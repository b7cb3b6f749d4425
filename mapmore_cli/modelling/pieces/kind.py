"""Pieces of curves, fused with smooth weights (M1, M2)."""

from mapmore_cli.domain.models import Pieces
from mapmore_cli.domain.results import PiecesFit
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("pieces", Pieces, PiecesFit, "pieces")
