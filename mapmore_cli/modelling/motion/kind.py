"""Linear sections along an input (P)."""

from mapmore_cli.domain.models import MotionFit, StateSpace
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("state_space", StateSpace, MotionFit, "motion")
