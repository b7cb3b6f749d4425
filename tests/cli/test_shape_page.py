"""A study with `fit.shape` from the spec to its page and exports; docs/shape.md fits its tables and
the code.
"""

import csv

import pytest
import shape_tables
from cli_samples import CONFIGS, csv_rows
from page_tables import DOCS, page_table

from mapmore_cli.modelling.shape import support

PAGE = DOCS / "shape.md"
SHAPE = "fit.shape={pressure: increasing, strain: decreasing}"
SETTINGS = ("--set", SHAPE, "--set", "fit.max_terms=3", "--set", "fit.beyond=0.2")
PLAIN = ("--set", "report.figures=[]", "--set", "validate={simple: false}")


@pytest.fixture(scope="module")
def kept(tmp_path_factory, mapmore):
    """The folder of a run of the simulated McKibben muscle that keeps its shape."""
    runs = tmp_path_factory.mktemp("shape")
    study = CONFIGS / "m2" / "dmsp-20-88-static.yaml"
    mapmore("run", study, "--runs", runs, "-q", *SETTINGS, *PLAIN, code=0)
    return runs / "dmsp-20-88-static"


def test_the_page_says_where_it_binds_and_what_it_costs(kept):
    with (kept / "report" / "tables" / "shape.csv").open() as file:
        rows = {row["along"]: row for row in csv.DictReader(file)}
    assert {row["violated by [N]"] for row in rows.values()} == {"0"}
    assert any(row["it binds at"] for row in rows.values())
    page = (kept / "report" / "index.html").read_text()
    assert "Shape of the surface" in page
    assert "RMSE with the shape | without: training" in page


def test_exports_promise_it_and_invert_says_unique(kept, mapmore, tmp_path):
    model = kept / "model.h5"
    promise = "The force is increasing in pressure, decreasing in strain over the training range"
    for to in ("c", "numpy"):
        mapmore("export", model, "--to", to, "-o", tmp_path / to, code=0)
        assert any(promise in path.read_text() for path in (tmp_path / to).iterdir())
    (tmp_path / "wanted.csv").write_text("force,strain\n300,0.05\n")
    shown = mapmore("invert", model, tmp_path / "wanted.csv", "--for", "pressure", code=0)
    assert csv_rows(shown.stdout)[0]["pressure_status"] == "unique"


def test_without_a_shape_the_page_judges_what_the_kind_implies(tmp_path, mapmore):
    study = CONFIGS / "m2" / "peano-static.yaml"
    mapmore("run", study, "--runs", tmp_path, "-q", *PLAIN, code=0)
    page = (tmp_path / "peano-static" / "report" / "index.html").read_text()
    assert "Known from the kind of muscle" in page


@pytest.mark.long
def test_a_study_of_the_table_is_made_anew(tmp_path):
    config = "m2/peano-static"
    for (study, split), some in shape_tables.by_split(config, tmp_path).items():
        row = page_table("studies", PAGE)[f"{study}, {split}"]
        assert shape_tables.ratio_of(some) == pytest.approx(float(row["error"]), abs=0.011)


def test_the_summary_keeps_what_the_page_promises():
    table = page_table("summary", PAGE)
    assert float(table["all"]["error"]) <= 0.95
    assert float(table["three levels"]["error"]) <= 0.88
    assert max(float(row["worst"]) for row in table.values()) <= 1.7
    assert {row["kept"] for row in table.values()} == {"0"}
    assert {row["kept several"] for row in table.values()} == {"0"}


def test_the_numbers_of_the_page_are_those_of_the_code():
    text = PAGE.with_name("keep-rising.md").read_text(encoding="utf-8")
    assert f"more than {support.CONTRADICTED * 100:.0f} %" in text
    assert support.FEWEST == 10
    assert "fewer than ten" in text
