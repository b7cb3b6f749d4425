"""A result file shown and used by the program in every way, without a checksum that vouches for its
values.
"""

import json
from contextlib import redirect_stdout, suppress
from io import StringIO

import h5py
import numpy as np

from mapmore_cli.annexes.exporting.exports import exported
from mapmore_cli.cli.console import print_view
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.cli.views import of_file
from mapmore_cli.modelling.kinds import equations
from mapmore_cli.pipeline.predict import predicted_lines
from mapmore_cli.storage import artefacts


def use(path, chance):
    """`show`, and with a model `predict` and `export`, all of them unverified; MapmoreError where
    one of them is refused.
    """
    with suppress(OSError, KeyError, RuntimeError), h5py.File(path, "r+") as file:
        del file.attrs["checksum"]
    with redirect_stdout(StringIO()) as shown:
        with Reporter(quiet=True) as reporter:
            view = of_file(path, reporter.warn, True)
        print_view(view, False)
        print_view(view, True)
    json.loads(
        shown.getvalue()[shown.getvalue().index("\n{\n") if "\n{\n" in shown.getvalue() else 0 :]
    )
    if artefacts.kind_of(path) == "model":
        with Reporter(quiet=True) as reporter, np.errstate(all="ignore"):
            model = artefacts.read_model(path, reporter.warn, unverified=True)
            list(predicted_lines(model, table_of(model), "table.csv"))
            equations(model)
            if chance.random() < 0.2:
                exported(model, chance.choice(["c", "py", "tex"]))


def table_of(model):
    """Rows of all that a model may ask for."""
    names = dict.fromkeys(
        ["time", *(quantity.name for quantity in model.inputs), model.output.name]
    )
    names |= (
        dict.fromkeys(name for name in model.fed_signals) if hasattr(model, "fed_signals") else {}
    )
    yield ",".join(names) + "\n"
    for row in range(12):
        yield ",".join(str(0.1 * row + 0.01 * place) for place, _ in enumerate(names)) + "\n"
