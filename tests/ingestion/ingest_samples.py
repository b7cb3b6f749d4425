"""Small recordings as text, and specs that read them."""

import numpy as np

from mapmore_cli.study.experiment import ExperimentSpec

COLUMNS = {
    "time": {"column": "t", "unit": "s"},
    "pressure": {"column": "P", "unit": "kPa"},
    "strain": {"column": "eps"},
    "force": {"column": "F", "unit": "N"},
}


def csv_text(**columns):
    """Columns as CSV with a header."""
    table = np.broadcast_arrays(*(np.asarray(values, dtype=float) for values in columns.values()))
    rows = [",".join(repr(float(cell)) for cell in row) for row in zip(*table, strict=True)]
    return "\n".join([",".join(columns), *rows]) + "\n"


def steps(level, samples=20, **changes):
    """A recording at one pressure."""
    t = np.arange(samples) * 0.1
    return csv_text(
        **{"t": t, "P": np.full(samples, level), "eps": 0.001 * t, "F": level - 10 * t, **changes}
    )


def spec_of(data, **spec):
    return ExperimentSpec.model_validate(
        {
            "name": "test",
            "target": "static",
            "dictionary": [{"terms": ["strain"]}],
            "data": {"columns": COLUMNS, **data},
            **spec,
        }
    )
