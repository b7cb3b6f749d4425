"""Joining the pieces: weights along segments and interpolation across levels (M1 eq 5-6, M2 eq 9-11)."""

from mapmore_cli.modelling.fusion.bands import Band, bands
from mapmore_cli.modelling.fusion.cells import TRANSITIONS, cell_weights, zones
from mapmore_cli.modelling.fusion.levels import carried_share, level_weights

__all__ = ["TRANSITIONS", "Band", "bands", "carried_share", "cell_weights", "level_weights", "zones"]
