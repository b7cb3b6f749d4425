"""Linear sections along an input (P)."""

from mapmore_cli.domain.models import StateSpace
from mapmore_cli.domain.motion import MotionFit
from mapmore_cli.modelling.kinds import Kind

KIND = Kind("state_space", StateSpace, MotionFit, "motion")
