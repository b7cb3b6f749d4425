"""docs/measured-static.md says what the studies say: its tables fit each other, the simulated ones
are run again.

`test_shipped_studies` runs the measured studies and holds them against the page.
"""

import numpy as np
import pytest
from cli_samples import CONFIGS, OWN, by_place, options
from page_tables import PAGE, page_table
from test_shipped_studies import NRMSE

from mapmore_cli.modelling.kinds import predict
from mapmore_cli.storage.artefacts import read_model
from mapmore_cli.study.campaign import load_campaign

CLOSING = ("ratio, geometric mean", "ratio, worst", "runs better", "below the best formula")
DIGITS = 0.006  # three of them


def test_the_piston_of_the_printed_cylinder(tmp_path, mapmore, measured_data):
    mapmore(
        "fuse", CONFIGS / "cylinder" / "printed_cylinder.yaml", "--runs", tmp_path, "-q", code=0
    )
    model = read_model(tmp_path / "printed_cylinder" / "model.h5")
    low, high = predict(
        model, {"pressure": np.array([200.0, 600.0]), "displacement": np.full(2, 0.01)}
    )
    slope = f"a constant and {(high - low) / 400:.3f} N/kPa"
    assert slope in PAGE.read_text(encoding="utf-8")


def test_the_simulated_studies_are_those_that_run():
    for name, row in page_table("m1").items():
        if name not in CLOSING:
            for model, nrmse in NRMSE[name].items():
                assert float(row[model]) == pytest.approx(100 * nrmse, rel=0.01)


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.long)])
def test_the_sweep_of_terms_gives_its_table(step, document):
    """Every fifth entry is one of each study and of each column."""
    _, entries = load_campaign(CONFIGS / "campaigns" / "m1_terms.yaml")
    table = page_table("m1-terms")
    columns = {"1": "one term", "2": "two", "3": "three", "order2": "two of 1, x, x²"}
    assert len(entries) == len(table) * len(columns)
    seen = set()
    for entry in entries[::step]:
        own = options(*entry.overrides, "validate.against=[]")
        told = document("validate", entry.config, "-q", *own)
        nrmse = by_place(told)[OWN]["nrmse"]
        study, _, variant = told["name"].rpartition("-")
        assert 100 * nrmse == pytest.approx(float(table[study][columns[variant]]), rel=DIGITS)
        seen |= {study, variant}
    assert seen == {*table, *columns}
