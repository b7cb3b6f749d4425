"""Joining the pieces: weights along segments and interpolation across levels (M1 eq 5-6, M2 eq 9-11)."""

from mapmore_cli.modelling.fusion.cells import TRANSITIONS, cell_weights, zones
from mapmore_cli.modelling.fusion.levels import carried_share, level_position, level_weights, shape_preserving

__all__ = ["TRANSITIONS", "carried_share", "cell_weights", "level_position", "level_weights", "shape_preserving", "zones"]
