"""Every formula of the literature is fitted to shipped studies as well as an independent global
search does; docs/formulas.md has the table, which `docs/formula_tables.py` makes.
"""

from pathlib import Path

import formula_tables
import global_fits
import pytest
from page_tables import rows_of

from mapmore_cli.annexes.sums.joint import fit_jointly
from mapmore_cli.modelling.literature import get, hinge
from mapmore_cli.modelling.literature.own import definition, formula_of
from mapmore_cli.study.sections.model import Summand

PAGE = Path(formula_tables.__file__).with_name("formulas.md")
QUICK = ("m1/dmsp-20-88-m1-hysteresis", "m1/peano-m1-hysteresis")

CASES = [
    pytest.param(study, name, marks=() if study in QUICK else pytest.mark.long)
    for study in formula_tables.STUDIES
    for name in formula_tables.formulas_of(study)
]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.mark.parametrize(("study", "name"), CASES)
def test_no_global_search_finds_a_lower_training_error(study, name, runs):
    """The search is as good as the fit too: what it misses it could not show."""
    one = formula_tables.fitted(study, name, runs)
    assert 0.998 < one.ratio < 1.01
    (printed,) = [
        [float(text) for text in cells[1:4]]
        for first, *cells in rows_of("competitors", PAGE)
        if (first, cells[0]) == (study.rpartition("/")[2], name)
    ]
    assert printed == pytest.approx([one.ours, one.least, one.ratio], rel=2e-4)


@pytest.mark.long
@pytest.mark.parametrize(
    ("study", "names"),
    [
        ("m1/dmsp-20-88-m1-static", ("sarosi", "bolen")),
        ("m1/dmsp-20-88-m1-static", ("tondu_lopez", "polynomial_5")),
        ("wrist/wrist-static", ("bolen", "polynomial_2")),
        ("m2/dmsp-20-88-damping", ("reynolds", "peternel")),
    ],
)
def test_no_global_search_finds_a_better_sum(study, names, runs):
    columns, y = formula_tables.pooled(study, runs)
    summands = [Summand(formula=name, inputs={x: x for x in get(name).inputs}) for name in names]
    fit = fit_jointly(summands, columns, y)
    least = global_fits.least_rmse(" + ".join(names), columns, y)
    assert 0.998 < formula_tables.rmse(fit) / least < 1.01


@pytest.mark.long
@pytest.mark.parametrize(
    ("study", "name"),
    [("m2/peano-damping", "tondu_kinetic_friction"), ("wrist/wrist-static", "kerscher")],
)
def test_a_formula_that_a_spec_defines_is_fitted_as_well_within_wide_bounds(study, name, runs):
    columns, y = formula_tables.pooled(study, runs)
    known, wide = get(name), global_fits.FITS[name]
    bounds = dict.fromkeys(known.parameters)
    for one, ends, per in zip(known.nonlinear, wide.ranges, wide.per, strict=True):
        span = global_fits._span(per, columns)
        bounds[one.name] = (ends[0] / span, ends[1] / span)
    fit = formula_of(definition("own", "here", known.text, bounds, {})).fit(columns, y)
    least = global_fits.least_rmse(name, columns, y)
    assert 0.998 < formula_tables.rmse(fit) / least < 1.01


def test_the_page_has_a_row_for_every_formula_of_every_study():
    rows = [(study, name) for study, name, *_ in rows_of("competitors", PAGE)]
    assert rows == [
        (study.rpartition("/")[2], name)
        for study in formula_tables.STUDIES
        for name in formula_tables.formulas_of(study)
    ]
    worst = max(float(cells[4]) for cells in rows_of("competitors", PAGE))
    assert f"The largest ratio of {len(rows)} is {worst:.4f}" in PAGE.read_text("utf-8")


def test_every_constant_of_the_hinge_has_a_row_with_its_value_and_reason():
    """None makes much of a difference where few levels leave most to the priors."""
    reasons = formula_tables.reasons()
    values = {name: (str(getattr(hinge, name)), why) for name, why in reasons.items()}
    rows = {name: cells for name, *cells in rows_of("hinge", PAGE)}
    assert {name: (cells[0], cells[3]) for name, cells in rows.items()} == values
    assert len(rows) == 16
    assert all(0.9 < float(one) < 1.2 for cells in rows.values() for one in cells[1:3])


def test_the_search_is_independent_of_the_program():
    assert "mapmore_cli" not in Path(global_fits.__file__).read_text("utf-8")
