"""The synthetic muscle of the gallery: static force over pressure (kPa) and strain, with noise and
a fixed seed.
"""

from __future__ import annotations

import sys
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure, SubFigure


def force(pressure: np.ndarray, strain: np.ndarray) -> np.ndarray:
    """Pull in N: a braided muscle that is stiff while it is crimped."""
    return np.asarray(
        3.3 * np.maximum(pressure - 25, 0) * (1 - 3.2 * strain) ** 2
        - 30
        + 60 * np.exp(-strain / 0.02)
    )


def recording(
    levels: list[float], noise: float = 2.0, count: int = 60, seed: int = 1
) -> dict[str, np.ndarray]:
    """Return a table of strain sweeps at some pressures."""
    pressure, strain = (
        grid.ravel() for grid in np.meshgrid(levels, np.linspace(0, 0.22, count), indexing="ij")
    )
    measured = force(pressure, strain) + noise * np.random.default_rng(seed).normal(
        size=len(strain)
    )
    return {"pressure": pressure, "strain": strain, "force": measured}


STUDY: dict[str, Any] = {
    "target": "static",
    "levels": {"of": "pressure", "at": "auto"},
    "segment": {"strain": {"method": "even", "count": 4}},
    "dictionary": [{"polynomial": {"of": ["strain"], "order": 4}}],
    "fit": {"max_terms": 2},
}


def save(figure: Figure | SubFigure, name: str) -> None:
    """Save a picture to the path on the command line, else beside the script's name."""
    assert isinstance(figure, Figure)
    mpl.rcParams["svg.hashsalt"] = name  # the same bytes each time
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else f"{name}.svg", metadata={"Date": None})
