"""docs/measured-static.md says what the studies say: its tables fit each other, the simulated ones
are run again.

`test_shipped_studies` runs the measured studies and holds them against the page.
"""

import numpy as np
import pytest
from cli_samples import CONFIGS
from page_tables import PAGE, page_table
from test_shipped_studies import NRMSE

from mapmore_cli.modelling.kinds import predict
from mapmore_cli.storage.artefacts import read_model

CLOSING = ("ratio, geometric mean", "ratio, worst", "runs better", "below the best formula")


def test_the_piston_of_the_printed_cylinder(tmp_path, mapmore, measured_data):
    mapmore(
        "fuse", CONFIGS / "cylinder" / "printed_cylinder.yaml", "--runs", tmp_path, "-q", code=0
    )
    model = read_model(tmp_path / "printed_cylinder" / "model.h5")
    low, high = predict(
        model, {"pressure": np.array([200.0, 600.0]), "displacement": np.full(2, 0.01)}
    )
    slope = f"a constant, plus {(high - low) / 400:.3f} N for each kPa"
    assert slope in PAGE.read_text(encoding="utf-8")


def test_the_simulated_studies_are_those_that_run():
    for name, row in page_table("m1").items():
        if name not in CLOSING:
            for model, nrmse in NRMSE[name].items():
                assert float(row[model]) == pytest.approx(100 * nrmse, rel=0.01)
