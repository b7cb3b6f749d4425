"""docs/motion.md says what the models say: its tables are made again here, from the files alone
where that is quick.
"""

from functools import cache

import numpy as np
import pytest
from page_tables import DOCS, page_table

from mapmore_cli.annexes.motion.fitting import fit_motion
from mapmore_cli.annexes.motion.problem import MotionRecipe
from mapmore_cli.annexes.motion.simulation import simulate
from mapmore_cli.modelling.memory.records import Record

PAGE = DOCS / "motion.md"
DATASETS = DOCS.parent / "datasets"
BOUNDARIES = (1.05, 2.35, 3.15, 3.95, 4.75)
FULL, PARTS = ("full",), tuple(f"section_{place}" for place in range(1, 7))
MODELS = {
    "linear": (FULL, {"solver": "swarm"}),
    "inflate_deflate": (FULL, {"solver": "swarm", "direction": True}),
    "piecewise": (PARTS, {"solver": "swarm", "sections": BOUNDARIES}),
    "piecewise_inflate_deflate": (
        PARTS,
        {"solver": "swarm", "sections": BOUNDARIES, "direction": True},
    ),
    "linear_least_squares": (FULL, {}),
    "piecewise_inflate_deflate_least_squares": (PARTS, {"sections": BOUNDARIES, "direction": True}),
}


@cache
def log(name):
    table = np.loadtxt(DATASETS / "waveforms" / f"{name}.csv", delimiter=",", skiprows=1)[::5]
    return {"time": table[:, 0], "input": table[:, 1], "displacement": table[:, 3] / 10}


def fitted(references, settings):
    records = [
        Record(log(f"reference_{name}"), np.ones(len(log(f"reference_{name}")["time"]), dtype=bool))
        for name in references
    ]
    return fit_motion(
        records, MotionRecipe(input="input", output="displacement", step=0.05, **settings)
    ).model


def table(name):
    return page_table(name, PAGE)


@pytest.mark.parametrize("model", MODELS)
def test_errors_by_waveform_are_made_again_from_the_recordings(model):
    motion = fitted(*MODELS[model])
    rows = table("waveforms")
    assert len(rows) == 14
    for name in (row for row in rows if not row.endswith(", largest")):
        record = log(f"waveform_{name}")
        tail = 20 if name == "rapid" else 80
        error = (simulate(motion, record) - record["displacement"])[-tail:]
        assert float(rows[name][model]) == pytest.approx(
            np.sqrt(np.mean(error**2)), rel=0.02, abs=6e-3
        )
        assert float(rows[f"{name}, largest"][model]) == pytest.approx(
            np.abs(error).max(), rel=0.02, abs=6e-3
        )
