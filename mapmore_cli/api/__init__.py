"""Use mapmore from Python, with the keys of the YAML spec as keyword arguments.

    import mapmore_cli as mm

`fit` makes a model from arrays, data frames or files. `run` does what `mapmore run` does.
`load_model` reads a model file that `run`, or the method `save` of a model, wrote. `example`
returns data for experiments. `FROLS` is the regression engine as an estimator. Only `run`, and the
methods `save`, `to_yaml` and `export` of a model, write files.
"""

from mapmore_cli.api.estimator import FROLS
from mapmore_cli.api.fitted import Fitted, Scores
from mapmore_cli.api.runs import Run, load_model, run
from mapmore_cli.api.sections import example, fit

__all__ = ["FROLS", "Fitted", "Run", "Scores", "example", "fit", "load_model", "run"]
