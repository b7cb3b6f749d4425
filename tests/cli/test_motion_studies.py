"""The shipped damping and dynamic studies: one run of the dynamic spec makes the static and the
damping study first.
"""

import json
import re

import damping_tables
import numpy as np
import pytest
from cli_samples import CONFIGS, by_place, csv_rows, held_out, options, without_figures, write_lines
from page_tables import DOCS, page_table
from pages import read_rows

import mapmore_cli
from mapmore_cli.storage.artefacts import read_dataset, read_model, read_validation

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


@pytest.mark.parametrize(
    ("name", "column"),
    [("dmsp-20-88", "McKibben"), pytest.param("peano", "Peano", marks=pytest.mark.long)],
)
def test_the_page_says_what_the_static_study_from_80_kpa_costs(name, column, tmp_path, mapmore):
    study = without_figures(M2 / f"{name}-damping-from-80.yaml", tmp_path)
    mapmore("validate", study, "-q", code=0)
    found = pooled(tmp_path / "runs" / study.stem)
    table = page_table("from80", DAMPING)
    told = {model: float(cells[column].strip("*")) for model, cells in table.items()}
    assert told == pytest.approx({model: 100 * found[model] for model in told}, abs=0.051)


@pytest.mark.parametrize(
    ("name", "kind"),
    [("dmsp-20-88", "McKibben"), pytest.param("peano", "Peano", marks=pytest.mark.long)],
)
def test_the_page_says_what_a_sensor_in_the_muscle_shows(name, kind, tmp_path, document):
    settings = options(
        "validate.against=[none, reynolds, peternel]",
        "report.published=null",
        "data.columns.pressure.column=Pm",
    )
    study = without_figures(M2 / f"{name}-damping.yaml", tmp_path)
    found = held_out(document("validate", study, "-q", *settings))
    row = page_table("untried", DAMPING)[f"{kind}: pressure taken in the muscle"]
    told = [float(row[model]) for model in ("mapmore", "none", "reynolds", "peternel")]
    assert told == pytest.approx(
        [100 * found[model]["nrmse"] for model in ("mapmore", "none", "reynolds", "peternel")],
        abs=0.051,
    )


@pytest.mark.usefixtures("measured_data")
def test_the_page_says_what_rates_are_worth_on_a_measured_muscle(document):
    found = by_place(document("validate", CONFIGS / "coiled" / "coiled_steps_rates.yaml", "-q"))
    models = ("static_map", "rise_and_fall_maps", "mapmore", "rates_without_direction")
    for (row, cells), model in zip(page_table("rates", DAMPING).items(), models, strict=True):
        told = [float(cells[column].strip("*")) for column in ("validation", "training")]
        assert told == pytest.approx(
            [100 * found[model, split, "all"]["nrmse"] for split in ("validate", "train")],
            abs=0.051,
        ), row


def test_one_command_makes_pages_with_records_over_time_and_equations_in_the_papers_units(muscle):
    name, runs = muscle
    for study in ("static-from-zero", "damping", "dynamic"):
        assert (runs / f"{name}-{study}" / "report" / "index.html").is_file()
    report = runs / f"{name}-damping" / "report"
    assert "plateau" in (report / "fit.svg").read_text()
    assert "published NRMSE" in (report / "index.html").read_text()
    rows = csv_rows((report / "tables" / "equations.csv").read_text())
    assert [row["id"] for row in rows] == ["all;direction=fall/all", "all;direction=rise/all"]
    (other,) = (column for column in rows[0] if column.startswith("with "))
    assert "strain_rate in 1/ms" in other
    here, there = (
        float(rows[0][column].removeprefix("'").partition("*")[0]) for column in ("equation", other)
    )
    squared = rows[0]["equation"].endswith("^2")
    assert there == pytest.approx(here * 1000.0 ** (2 if squared else 1))


def test_a_table_of_time_pressure_and_strain_predicts_what_was_validated(muscle, tmp_path, mapmore):
    """Rates and direction follow from the table as they did at ingest; two recordings in one table
    are told apart.
    """
    name, runs = muscle
    run_dir = runs / f"{name}-dynamic"
    curves = read_dataset(run_dir / "ingest.h5").curves[:2]
    lines = [
        f"{curve.id},{t!r},{p!r},{e!r}"
        for curve in curves
        for t, p, e in zip(
            *(curve.columns[column].tolist() for column in ("time", "pressure", "strain")),
            strict=True,
        )
    ]
    write_lines(tmp_path / "table.csv", "recording,time,pressure,strain", *lines)
    done = mapmore("predict", run_dir / "model.h5", "table.csv", code=0)
    found = [float(row["force_predicted"]) for row in csv_rows(done.stdout)]
    wanted = np.concatenate(read_validation(run_dir / "validate.h5").predictions["mapmore"][:2])
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)
    first = {column: curves[0].columns[column] for column in ("time", "pressure", "strain")}
    model = mapmore_cli.load_model(run_dir / "model.h5")
    # rates of the held-out step, and strains before it
    with pytest.warns(UserWarning, match="outside of the training range"):
        np.testing.assert_allclose(model(**first), wanted[: len(first["time"])], atol=1e-6)


def test_the_dynamic_model_is_the_sum_of_the_two(muscle):
    name, runs = muscle
    model = read_model(runs / f"{name}-dynamic" / "model.h5")
    assert [part.model.name for part in model.body.parts] == [
        f"{name}-static-from-zero",
        f"{name}-damping",
    ]
    predictions = read_validation(runs / f"{name}-dynamic" / "validate.h5").predictions
    own = read_validation(runs / f"{name}-damping" / "validate.h5").predictions["mapmore"]
    for total, static, damping in zip(
        predictions["mapmore"], predictions["static_alone"], own, strict=True
    ):
        assert np.allclose(total, static + damping, atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("table", ["rigs", "transients", "slopes", "hysteresis"])
def test_other_rigs_and_what_explains_m2s_errors(table, tmp_path):
    found = damping_tables.TABLES[table](tmp_path)
    assert [list(row) for row in (found.headings, *found.shown)] == read_rows(DAMPING, table)


def test_a_table_without_time_says_what_it_lacks(muscle, mapmore):
    name, runs = muscle
    mapmore(
        "predict",
        runs / f"{name}-dynamic" / "model.h5",
        "-",
        stdin="pressure,strain\n100,0.1\n",
        code=4,
        says="time",
    )
