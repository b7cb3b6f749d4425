"""Fit piecewise models of soft actuators to measured curves (the method MAPMORE).

import mapmore_cli as mm

m = mm.fit(frame, target="static", ...)   # keyword arguments are the sections of a spec
r = mm.run("muscle.yaml")                 # the same as `mapmore run muscle.yaml`
m = mm.load_model("model.h5")
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mapmore_cli.api import FROLS, Fitted, Run, Scores, example, fit, load_model, run

__all__ = [
    "FROLS",
    "Fitted",
    "Run",
    "Scores",
    "__version__",
    "example",
    "fit",
    "load_model",
    "run",
]

__version__ = "1.0.0"

THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Environment variables by which libraries choose their number of threads when they start."""


def __getattr__(name: str) -> Any:
    """Load the Python interface only when one of its names is first used, so that the command line
    starts without NumPy.
    """
    if name not in __all__:
        raise AttributeError(f"module 'mapmore_cli' has no attribute '{name}'")
    return getattr(import_module("mapmore_cli.api"), name)


def __dir__() -> list[str]:
    """Return all names of the Python interface, including those that are not loaded yet."""
    return __all__
