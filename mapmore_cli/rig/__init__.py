"""Synthetic muscles and rigs, whose equations are none of the fitted models' forms."""
