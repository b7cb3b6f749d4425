"""docs/measured-static.md says what the studies say: its tables fit each other, the simulated ones
are run again.

`test_shipped_studies` runs the measured studies and holds them against the page.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from page_tables import PAGE, numbers, page_table
from test_shipped_studies import CONFIGS, NRMSE

from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import Cuts, Recipe
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.spec.campaign import load_campaign
from mapmore_cli.storage.artefacts import read_model

CLOSING = ("ratio, geometric mean", "ratio, worst", "runs better", "below the best formula")
DIGITS = 0.006  # three of them


def measured() -> dict[str, dict[str, float]]:
    return {
        name: numbers(row) for name, row in page_table("measured").items() if name not in CLOSING
    }


def best_formula(row: dict[str, float]) -> float:
    campaign, _ = load_campaign(CONFIGS / "campaigns" / "measured_static.yaml")
    return min(row[name] for name in campaign.best_of)


def test_there_are_the_eleven_cases_with_all_formulas_and_polynomials() -> None:
    campaign, entries = load_campaign(CONFIGS / "campaigns" / "measured_static.yaml")
    assert list(measured()) == [entry.config.stem for entry in entries]
    assert (len(measured()), len(campaign.best_of)) == (11, 10)
    wanted = {"mapmore", "m2_default", "bare", "on_sarosi", "on_sarosi_hinged", *campaign.best_of}
    assert all(wanted <= set(row) for row in measured().values())
    assert sum("repeatability" in row for row in measured().values()) == 9


def test_the_limits_are_kept() -> None:
    """Geometric mean of the ratio to Sarosi 0.5, each 1.2, third repeats 1.2 times the
    repeatability, below the best formula in eight.
    """
    rows = measured()
    ratios = [row["mapmore"] / row["sarosi"] for row in rows.values()]
    assert math.exp(sum(map(math.log, ratios)) / len(ratios)) <= 0.5
    assert max(ratios) <= 1.2
    assert (
        max(
            row["mapmore"] / row["repeatability"]
            for name, row in rows.items()
            if name.endswith("_repeat")
        )
        <= 1.2
    )
    assert sum(row["mapmore"] < best_formula(row) for row in rows.values()) >= 8


def test_the_choice_of_the_program_is_what_its_column_says() -> None:
    """Where it takes the backbone of another column, it has that column's error; ratios are to
    Sarosi's formula and to the best.
    """
    table = page_table("auto")
    ratios: dict[str, list[float]] = {"ratio to sarosi": [], "ratio to the best formula": []}
    for name, errors in measured().items():
        row = numbers(table[name])
        if table[name]["chosen"] == "sarosi_hinged":
            assert row["NRMSE"] == pytest.approx(errors["on_sarosi_hinged"], rel=DIGITS)
        for ratio, other in (
            ("ratio to sarosi", errors["sarosi"]),
            ("ratio to the best formula", best_formula(errors)),
        ):
            assert row[ratio] == pytest.approx(row["NRMSE"] / other, rel=2 * DIGITS)
            ratios[ratio].append(row[ratio])
    for ratio, values in ratios.items():
        assert float(table["geometric mean"][ratio]) == pytest.approx(
            math.exp(sum(map(math.log, values)) / 11), rel=DIGITS
        )
        assert float(table["worst"][ratio]) == pytest.approx(max(values), rel=DIGITS)
    assert float(table["geometric mean"]["ratio to sarosi"]) <= 0.20


def test_the_gel_muscle_is_what_its_recordings_say(measured_data: Path) -> None:
    """The polynomials, left out by least squares of their own; the means of all models."""
    table = {model: numbers(row) for model, row in page_table("pgm").items()}
    files = sorted((measured_data / "pgm_mckibben").glob("pgm_*kPa.csv"))
    rows = np.concatenate([np.genfromtxt(path, delimiter=",", names=True) for path in files])
    p, e, force = rows["pressure_kPa"] / 300, rows["strain"], rows["force_N"]
    for order in (2, 5):
        powers = [
            (i, j)
            for i in range(order + 1)
            for j in range(order + 1 - i)
            if (order, i, j) != (2, 0, 2)
        ]  # M2 eq 15 has no P^2
        terms = np.column_stack([e**i * p**j for i, j in powers])
        for pressure in (50, 100, 150, 200, 250):
            out = rows["pressure_kPa"] == pressure
            beta = np.linalg.lstsq(terms[~out], force[~out], rcond=None)[0]
            error = np.sqrt(np.mean((terms[out] @ beta - force[out]) ** 2)) / force.max()
            assert 100 * error == pytest.approx(
                table[f"polynomial_{order}"][f"{pressure} kPa"], rel=0.01
            )
    for row in table.values():
        assert row["mean"] == pytest.approx(
            sum(row[f"{pressure} kPa"] for pressure in (50, 100, 150, 200, 250)) / 5, rel=DIGITS
        )


def test_the_gel_muscle_is_better_the_other_way_round(measured_data: Path) -> None:
    """The inverted model has the least mean; the fold without 100 kPa again, inverted by a look at
    every force of a fine grid.
    """
    table = {model: numbers(row) for model, row in page_table("pgm").items()}
    inverted = table["mapmore, strain inverted"]
    assert inverted["mean"] <= 6.5
    assert inverted["mean"] == min(row["mean"] for row in table.values())
    curves, quantities = (
        [],
        {
            "pressure": Quantity("pressure", "kPa"),
            "strain": Quantity("strain", "1"),
            "force": Quantity("force", "N"),
        },
    )
    for path in sorted((measured_data / "pgm_mckibben").glob("pgm_*kPa.csv")):
        rows = np.genfromtxt(path, delimiter=",", names=True)
        columns = {
            "pressure": rows["pressure_kPa"],
            "strain": rows["strain"],
            "force": rows["force_N"],
        }
        level = float(columns["pressure"][0])
        curves.append(
            Curve(
                f"pressure={level:g}",
                level,
                columns,
                np.full(len(rows), level == 100.0),
                (path.stem,),
            )
        )
    recipe = Recipe(
        target="strain",
        dictionary=("1", "force", "force^2", "force^3"),
        cuts={"force": Cuts("even", 3, min_samples=6)},
        level="pressure",
        fit=Fit(max_terms=3, stop="bic"),
    )
    model = build("strain", curves, recipe, quantities)
    left_out = next(curve for curve in curves if curve.level == 100.0).columns
    forces = np.linspace(0.5, 49.5, 1500)
    strains = predict(model, {"pressure": np.full(1500, 100.0), "force": forces})
    nearest = forces[np.argmin(np.abs(strains[None, :] - left_out["strain"][:, None]), axis=1)]
    error = np.sqrt(np.mean((nearest - left_out["force"]) ** 2)) / max(
        curve.columns["force"].max() for curve in curves
    )
    assert 100 * error == pytest.approx(inverted["100 kPa"], rel=0.02)


def test_the_sentences_follow_from_the_tables() -> None:
    text, mean = (
        PAGE.read_text(encoding="utf-8"),
        {model: row["mean"] for model, row in page_table("pgm").items()},
    )
    told = [mean[model] for model in ("mapmore, strain inverted", "cubic", "mapmore", "sarosi")]
    assert (
        "inverted model has {} %, the cubic {}, the direct model {}, Sárosi's formula {}.".format(
            *told
        )
        in text
    )
    family = {model: row["NRMSE"] for model, row in page_table("family").items()}
    told = [
        family[model]
        for model in ("mapmore", "polynomial_5", "sarosi_hinged", "sarosi", "repeatability")
    ]
    said = (
        "`mapmore` has {} %, `polynomial_5` {}, `sarosi_hinged` {}, `sarosi` {}; the "
        "repeatability is {}."
    )
    assert said.format(*told) in text
    hold = {group: float(row["geometric mean"]) for group, row in page_table("hold").items()}
    told = [100 * (hold[group] - 1) for group in ("measured, the study's settings", "M1's studies")]
    assert (
        "the error is {:.1f} % larger in the geometric mean of eleven measured studies, and "
        "{:.1f} % in M1's".format(*told)
        in text
    )
    terms = page_table("m1-terms")["peano-m1-static"]
    assert (
        "the error is {one term} % with one, {two} with two, {three} with three".format(**terms)
        in text
    )


def test_the_piston_of_the_printed_cylinder(tmp_path: Path, mapmore, measured_data: Path) -> None:
    """The sentences follow from the table, and the slope from the model."""
    text, row = (
        PAGE.read_text(encoding="utf-8"),
        {model: cells["NRMSE"] for model, cells in page_table("cylinder").items()},
    )
    said = "errs by {mapmore} %, by {nominal} with nominal pressures, by {by_level} with a function"
    assert said.format(**row) in text
    assert "displacement has {plane}; a quadratic, {quadratic}, follows".format(**row) in text
    mapmore(
        "fuse", CONFIGS / "cylinder" / "printed_cylinder.yaml", "--runs", tmp_path, "-q", code=0
    )
    model = read_model(tmp_path / "printed_cylinder" / "model.h5")
    low, high = predict(
        model, {"pressure": np.array([200.0, 600.0]), "displacement": np.array([0.01, 0.01])}
    )
    assert f"a constant and {(high - low) / 400:.3f} N/kPa" in text


def test_a_map_of_few_points_is_below_the_best_formula() -> None:
    table = {held_out: numbers(row) for held_out, row in page_table("maps").items()}
    assert len(table) == 2
    for row in table.values():
        assert (
            max(row[shape] for shape in ("by level", "one surface", "one surface, cut"))
            < row["its error"]
        )
    pressures, strain = table.values()
    assert strain["one surface"] < strain["by level"]
    text = PAGE.read_text(encoding="utf-8")
    assert (
        f"each level errs by {pressures['by level']} %, a surface by {pressures['one surface']}."
        in text
    )
    assert (
        f"better: {strain['one surface']} and {strain['by level']}, cut "
        f"{strain['one surface, cut']}." in text
    )


def test_holding_helps_measured_muscles_and_not_the_papers() -> None:
    rows = {name: numbers(row) for name, row in page_table("hold").items()}
    assert [row["number"] for row in rows.values()] == [11, 11, 4]
    assert rows["measured, the study's settings"]["least ratio"] > 0.99
    assert all(
        row["least ratio"] <= row["geometric mean"] <= row["greatest"] for row in rows.values()
    )


def test_the_simulated_studies_are_those_that_run() -> None:
    for name, row in page_table("m1").items():
        if name not in CLOSING:
            for model, nrmse in NRMSE[name].items():
                assert float(row[model]) == pytest.approx(100 * nrmse, rel=0.01)


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.long)])
def test_the_sweep_of_terms_gives_its_table(step: int, tmp_path: Path, mapmore) -> None:
    """Every fifth entry is one of each study and of each column."""
    _, entries = load_campaign(CONFIGS / "campaigns" / "m1_terms.yaml")
    table = page_table("m1-terms")
    columns = {"1": "one term", "2": "two", "3": "three", "order2": "two of 1, x, x²"}
    assert len(entries) == len(table) * len(columns)
    seen = set()
    for entry in entries[::step]:
        overrides = [part for override in entry.overrides for part in ("--set", override)]
        result = mapmore(
            "validate",
            entry.config,
            "--runs",
            tmp_path,
            "--json",
            "-q",
            *overrides,
            "--set",
            "validate.against=[]",
        )
        document = json.loads(result.stdout)
        (nrmse,) = (
            row["nrmse"]
            for row in document["scores"]
            if (row["split"], row["curve"]) == ("validate", "all")
        )
        study, _, variant = document["name"].rpartition("-")
        assert 100 * nrmse == pytest.approx(float(table[study][columns[variant]]), rel=DIGITS)
        seen |= {study, variant}
    assert seen == {*table, *columns}
