"""A length is a displacement that stands far from zero: it gets the same model, and its page says
how little an NRMSE of it says.
"""

import json

import numpy as np
from cli_samples import write_columns

SPEC = """\
schema_version: 1
name: {name}
data:
  files: [m.csv]
  columns: {{time: {{column: t}}, pressure: {{column: P}}, x: {{column: {column}, unit: m}}}}
  split: {{validate: {{last: 0.5}}}}
target: {{column: x}}
dictionary: [{{products: {{of: [{{slow: {{of: [pressure], tau: [0.2, 1]}}}}], order: 2}}}}]
fit: {{max_terms: 6{fit}}}
validate: {{simple: false}}
"""


def study(folder, column, fit=""):
    """A muscle that follows the square of a slow pressure, by its displacement x and by its length
    L.
    """
    time = np.arange(600) * 0.05
    pressure = 200 + 100 * np.sin(time) + 60 * np.sin(2.7 * time)
    slow = np.zeros(600)
    for k in range(1, 600):
        slow[k] = slow[k - 1] + 0.1 * (pressure[k] - slow[k - 1])
    x = 4e-3 * (slow / 300) ** 2 + 2e-5 * np.random.default_rng(0).normal(size=600)
    write_columns(folder / "m.csv", "t,P,x,L", time, pressure, x, 0.5 - x)
    spec = folder / f"{column}.yaml"
    spec.write_text(SPEC.format(name=column, column=column, fit=fit))
    return spec


def test_errors_by_range_stand_beside(tmp_path, mapmore):
    done = mapmore("run", study(tmp_path, "L"), code=0)
    assert "by range [%]" in done.stdout
    page = (tmp_path / "runs/L/report/index.html").read_text()
    assert "of the range: the target lies far from zero" in page
    near = mapmore("run", study(tmp_path, "x"), code=0)
    assert "by range" not in near.stdout
    mapmore(
        "validate", tmp_path / "L.yaml", "--set", "validate.require={nrmse_range: 1e-4}", code=6
    )


def test_a_constant_by_itself_is_told(tmp_path, mapmore):
    spec = study(tmp_path, "L")
    spec.write_text(spec.read_text().replace("max_terms: 6", "max_terms: 1"))
    alone = "the model is the constant only: it explains all but"
    mapmore("fit", spec, code=0, says=alone)
    done = mapmore(
        "validate", spec, "--json", code=0, says=(alone, "R² on the training data is 0:")
    )
    told = json.loads(done.stdout)["warnings"]
    assert len(told) == len(set(told))
    assert any(
        "R² on the training data is 0: the model is no better than the mean" in one for one in told
    )
