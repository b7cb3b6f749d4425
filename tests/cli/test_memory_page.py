"""docs/memory.md says what the runs say: its tables fit each other, and some of the runs are done
again.
"""

import json

import pytest
from cli_samples import CONFIGS, OWN, by_place, options
from page_tables import MEMORY, numbers, page_table

from mapmore_cli.storage.artefacts import read_model
from mapmore_cli.study.campaign import load_campaign

FEWER = "steps-2-500g"
"""Beside a competitor that does not predict all of its samples, this one has fewer; the table of
cuts has it by itself.
"""
AGAIN = {"coiled": ["loops-2-200g", FEWER], "coiled_other_load": ["loads-2-400g-from-300g-500g"]}
"""Runs of the campaigns that are done again: one that needs no cutting, one that does, and one of
another load.
"""


def campaign(name):
    """A shipped campaign, its runs by their names."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / f"{name}.yaml")
    return spec, {
        str(variant.name): entry for variant, entry in zip(spec.runs, entries, strict=True)
    }


def test_the_campaign_has_every_record_and_one_fragment():
    spec, runs = campaign("coiled")
    assert [
        sum(variant.group == group for variant in spec.runs) for group in ("steps", "loops")
    ] == [10, 5]
    assert {entry.config.name for entry in runs.values()} == {
        "coiled_steps.yaml",
        "coiled_loops.yaml",
    }
    assert all(set(variant.set) <= {"data.files"} for variant in spec.runs)


@pytest.mark.parametrize(
    ("table", "name"), [(table, name) for table, names in AGAIN.items() for name in names]
)
def test_a_run_gives_what_the_page_says(table, name, document, measured_data):
    _, runs = campaign(table)
    cut = name == FEWER
    told = numbers(page_table("uncut" if cut else table, MEMORY)[name])["cut" if cut else "mapmore"]
    own = options(*runs[name].overrides, "validate.against=[]")
    found = by_place(document("validate", runs[name].config, "-q", *own))
    assert 100 * found[OWN]["nrmse"] == pytest.approx(told, rel=0.02)


def test_the_true_terms_of_the_simulated_record(tmp_path, mapmore, measured_data):
    mapmore(
        "fuse",
        CONFIGS / "identification" / "data_for_testing.yaml",
        "--runs",
        tmp_path,
        "-q",
        code=0,
    )
    model = read_model(tmp_path / "data_for_testing" / "model.h5").body.model
    truth = {
        "x[k-2]": 0.6,
        "y[k-2]": -0.5,
        "x[k-1]*y[k-1]": 0.7,
        "x[k-2]*y[k-2]": -0.7,
        "y[k-1]^2": 0.2,
    }
    assert dict(zip(model.terms, model.theta, strict=True)) == pytest.approx(truth, abs=1e-6)


def test_identification_records_run_as_freely_as_the_peers(measured_data):
    """`test_shipped_studies` holds our figures against runs; the peer's are those of its file."""
    peer = json.loads(
        (measured_data / "system_identification" / "peer_sysidentpy.json").read_text()
    )["runs"]
    rows = page_table("identification", MEMORY)
    for name, run in (
        ("buck", "buck_deg2_lag2_n8"),
        ("motor_generator", "generator_dec500_deg2_lag2_n8"),
    ):
        row = numbers(rows[name])
        assert row["peer's"] == pytest.approx(peer[run]["rrse_free"], abs=1e-5)
        assert row["peer's one step"] == pytest.approx(peer[run]["rrse_one"], abs=1e-5)
        assert row["RRSE, free run"] == pytest.approx(row["peer's"], rel=0.005)
        assert row["RRSE, one step"] == pytest.approx(row["peer's one step"], rel=0.005)
