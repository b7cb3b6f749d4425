"""Cutting training curves into segments (M1 section III, IV.A)."""

from mapmore_cli.modelling.segmentation.curves import segment_curve, segment_id, trained_at, training_curves
from mapmore_cli.modelling.segmentation.cuts import IntervalCost, cut_points
from mapmore_cli.modelling.segmentation.samples import samples_of

__all__ = ["IntervalCost", "cut_points", "samples_of", "segment_curve", "segment_id", "trained_at", "training_curves"]
