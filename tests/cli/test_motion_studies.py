"""The shipped damping and dynamic studies: one run of the dynamic spec makes the static and the
damping study first.
"""

import json
import re

import damping_tables
import pytest
from cli_samples import CONFIGS, held_out, without_figures
from page_tables import DOCS, page_table
from pages import read_rows

M2 = CONFIGS / "m2"
DAMPING = DOCS / "damping.md"

SHOWN = {study: damping_tables.ROWS[study] for study in ("damping", "dynamic")}
"""Rows of the tables of docs/damping.md, and the models that they are about."""


def pooled(run_dir):
    return {
        model: row["nrmse"]
        for model, row in held_out(json.loads((run_dir / "scores.json").read_text())).items()
    }


LOOKED_AT = "dmsp-20-88"
TWIN = pytest.param("peano", marks=pytest.mark.long)
"""The other muscle, whose studies are the same."""


@pytest.fixture(scope="module", params=["dmsp-20-88", TWIN])
def muscle(request, tmp_path_factory, mapmore):
    """A muscle and the folder of its runs, made by one command. One study has figures: the one that
    is looked at, or all.
    """
    runs = tmp_path_factory.mktemp(request.param)
    figures = ["fit"] if request.param == LOOKED_AT else None
    study = without_figures(
        M2 / f"{request.param}-dynamic.yaml",
        runs,
        but=f"{request.param}-damping",
        figures=figures,
    )
    mapmore("run", study, "--runs", runs, "-q", code=0)
    return request.param, runs


@pytest.mark.parametrize("study", SHOWN)
def test_the_page_shows_what_the_runs_say(study, muscle):
    name, runs = muscle
    found, table = pooled(runs / f"{name}-{study}"), page_table(study, DAMPING)
    assert set(table) == set(SHOWN[study])
    for row, models in SHOWN[study].items():
        told = re.sub(
            r"\([^)]*\)|\*", "", table[row]["McKibben" if name == "dmsp-20-88" else "Peano"]
        ).split("/")
        assert [float(per_cent) for per_cent in told] == pytest.approx(
            [100 * found[model] for model in models], abs=0.051
        )


@pytest.mark.long
@pytest.mark.parametrize("table", ["rigs", "transients", "slopes", "hysteresis"])
def test_other_rigs_and_what_explains_m2s_errors(table, tmp_path):
    found = damping_tables.TABLES[table](tmp_path)
    assert [list(row) for row in (found.headings, *found.shown)] == read_rows(DAMPING, table)
