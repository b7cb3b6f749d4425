"""Piecewise state-space models of motion (P): linear sections of second order along an input, such
as a regulator's voltage.
"""

from mapmore_cli.annexes.motion.body import MotionFit, StateSpace
from mapmore_cli.annexes.motion.problem import MotionSettings
from mapmore_cli.modelling.kinds import Kind

KIND = Kind(
    "state_space",
    StateSpace,
    MotionFit,
    __name__,
    over_time=True,
    settings=MotionSettings,
    fitted=f"{__name__}.fitted",
)
