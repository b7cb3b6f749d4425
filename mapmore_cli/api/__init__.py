"""The program in Python: the words of the YAML spec as keyword arguments.

    import mapmore_cli as mm

`fit` makes a model of arrays, of data frames or of files; `run` does what `mapmore run` does;
`load_model` reads what either wrote; `example` gives data to try them on; `FROLS` is the regression
engine as an estimator. Nothing is written but by `run`, and by `save`, `to_yaml` and `export` of a
model.
"""

from mapmore_cli.api.estimator import FROLS
from mapmore_cli.api.fitted import Fitted, Scores
from mapmore_cli.api.runs import Run, load_model, run
from mapmore_cli.api.sections import example, fit

__all__ = ["FROLS", "Fitted", "Run", "Scores", "example", "fit", "load_model", "run"]
