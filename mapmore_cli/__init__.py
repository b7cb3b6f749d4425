"""MAPMORE: piecewise models of soft actuators from measured curves."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mapmore_cli.stages.prediction.loaded_model import LoadedModel

__all__ = ["__version__", "load_model"]

__version__ = "0.1.0"


def load_model(path: str | Path, *, unverified: bool = False) -> LoadedModel:
    """Read a `model.h5` as a function of keyword arrays: `load_model("model.h5")(pressure=[100, 200], strain=0.1)`.

    Warns (UserWarning) where nothing shows that the file is as it was written.

    Raises
    ------
    mapmore_cli.domain.errors.DataError
        The file is missing, damaged or no valid model, or its checksum does not match (but not where it may be `unverified`).
    """
    from mapmore_cli.stages.prediction.loaded_model import LoadedModel  # here, so that the command line starts without NumPy
    from mapmore_cli.storage.artefacts import read_model
    from mapmore_cli.storage.score_files import scores_beside

    model = read_model(Path(path), lambda message: warnings.warn(message, stacklevel=4), unverified)
    return LoadedModel(model, scores_beside(Path(path)))
