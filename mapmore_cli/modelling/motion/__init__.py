"""Piecewise state-space models of motion (P): linear sections of second order along an input, such
as a regulator's voltage.
"""

from mapmore_cli.domain.models import MotionFit, StateSpace
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("state_space", StateSpace, MotionFit, "motion")
