"""Scaling and fit of one segment: the unit square, its anchors, and segments so long that their
dictionary is made block by block.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from surfaces import curves, recipe

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Segment
from mapmore_cli.domain.recording import uncertainty_of
from mapmore_cli.modelling.expressions import dictionary_matrix, parse, to_text
from mapmore_cli.modelling.expressions.families import products
from mapmore_cli.modelling.frols import frols, reads_once
from mapmore_cli.modelling.frols.weighing import Choice
from mapmore_cli.modelling.pieces import segment_fit
from mapmore_cli.modelling.pieces.build import segment
from mapmore_cli.modelling.pieces.placement import end_of_trend
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.segment_fit import fit_together, quantities_in
from mapmore_cli.modelling.pieces.segmentation import scaled_inputs

seeds = st.integers(0, 2**32 - 1)


def falling(seed):
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(0.02, 0.1, 60))
    return x, 700 * np.exp(-x / 0.05) - 50 + rng.normal(0, 2, 60)


@given(seeds)
def test_of_placements_that_err_alike_the_first_is_taken(seed):
    """All terms span the same functions from either end, so that only rounding tells them apart."""
    x, y = falling(seed)
    made = recipe(dictionary=("1", "strain", "strain^2"), max_terms=3, tolerance=0.0)
    own = Segment("all/all", "all", (), np.arange(60))
    (found,) = fit_together(own, {"strain": x, "force": y}, products(["strain"], 2), [made])
    assert found.scaling.placement == "left"


@pytest.mark.parametrize("loss", ["squares", "huber"])
def test_only_the_fit_that_is_kept_gets_standard_errors(loss, monkeypatch):
    """Other placements, robust starts and trials of `optimal` cuts are compared by what they leave
    alone; standard errors would take as long as all of that.
    """
    counted, with_errors = [], Choice.with_errors
    monkeypatch.setattr(
        Choice, "with_errors", lambda choice: counted.append(choice) or with_errors(choice)
    )
    x, y = falling(1)
    fitted(x, y, loss=loss)
    assert len(counted) == 1
    trials = recipe(cuts={"strain": Cuts("optimal", 2)}, loss=loss)
    assert segment(curves(n=40)[:1], trials)
    assert len(counted) == 1


@given(seeds, st.sampled_from([1.0, 0.05, 20.0]), st.integers(4, 150))
def test_the_anchor_is_on_a_parabola_through_the_weight_of_the_nearest_samples(seed, near, n):
    """Six samples of the median weight, or 5 % of the samples and one, whatever they weigh."""
    rng = np.random.default_rng(seed)
    away, y, weights = np.linspace(0, 1, n), rng.normal(0, 1, n), rng.uniform(1, 2, n)
    nearest = int(np.ceil(0.05 * n))
    weights[:nearest] *= near
    wanted, rows = (max(3, nearest) + 1) * np.median(weights) * (1 - 1e-9), 1
    while rows < n and (weights[:rows].sum() < wanted or rows < nearest):
        rows += 1
    slopes = np.polyfit(away[:rows], y[:rows], min(2, rows - 1), w=np.sqrt(weights[:rows]))
    expected = np.polyval(slopes, away[:nearest]).mean()
    assert end_of_trend(away[None], y, weights) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(("missing", "rows"), [(0.5e-9, 3), (5e-9, 4)])
def test_a_parabola_needs_a_further_sample_unless_rounding_has_made_the_weight_too_small(
    missing, rows
):
    """The wanted weight is that of four samples, of which the first three lack a fraction."""
    away, y, weights = np.linspace(0, 1, 20), np.random.default_rng(0).normal(size=20), np.ones(20)
    weights[:3] = 1.5, 1.5, 1 - 4 * missing
    slopes = np.polyfit(away[:rows], y[:rows], 2, w=np.sqrt(weights[:rows]))
    assert end_of_trend(away[None], y, weights) == pytest.approx(slopes[-1], abs=1e-6)


def test_weights_that_only_rounding_tells_apart_are_alike():
    away, y = np.linspace(0, 1, 100)[None], np.random.default_rng(0).normal(0, 1, 100)
    for unit in (1e-6, 1.0, 1e6):
        weights = unit * (1 + 4e-13 * (np.arange(100) % 2))
        assert end_of_trend(away, y, weights) == pytest.approx(y[:5].mean())
    unlike = 1 + 4e-12 * (np.arange(100) % 2)
    assert abs(end_of_trend(away, y, unlike) - y[:5].mean()) > 1e-3


def test_quantities_are_in_alphabetical_order():
    assert quantities_in([parse("h*g*f + e*d"), parse("c*b*a")]) == tuple("abcdefgh")


POWERS = products(["strain"], 4)
PLACES = np.linspace(0, 0.25, 101)


def fitted(x, y, sigma=None, **settings):
    """The curve of one segment at even places."""
    made = recipe(dictionary=tuple(map(to_text, POWERS)), **{"max_terms": 1, **settings})
    columns = {"strain": x, "force": y} | (
        {} if sigma is None else {uncertainty_of("force"): sigma}
    )
    one = Segment("all/all", "all", (), np.arange(len(x)))
    (found,) = fit_together(one, columns, POWERS, [made])
    scaled = scaled_inputs(found.scaling, {"strain": PLACES})
    P = dictionary_matrix([parse(term) for term in found.terms], scaled, len(PLACES))
    return found.scaling.y_intercept + found.scaling.y_slope * (P @ found.selection.theta)


@pytest.mark.parametrize("scaling", ["unit_square", "max_abs", "none"])
@pytest.mark.parametrize("terms", [1, 2])
@pytest.mark.parametrize("n", [12, 40, 90])
def test_weights_are_repeated_rows(scaling, terms, n):
    rng = np.random.default_rng(n)
    x, k = np.sort(rng.uniform(0, 0.25, n)), rng.integers(1, 6, n)
    y = 200 * (1 - x / 0.25) ** 2 + rng.normal(0, 2, n)
    how = {"scaling": scaling, "max_terms": terms}
    weighted = fitted(x, y, 3 / np.sqrt(k), **how)
    assert weighted == pytest.approx(fitted(np.repeat(x, k), np.repeat(y, k), **how), abs=1e-9)


def test_a_segment_needs_more_samples_than_terms():
    x, y = falling(1)
    for n in (3, 4):
        own = Segment("all/all", "all", (), np.arange(n))
        made = recipe(dictionary=tuple(map(to_text, POWERS)), max_terms=3)
        if n == 4:
            assert fit_together(own, {"strain": x, "force": y}, POWERS, [made])
            continue
        with pytest.raises(DataError, match=r"3 training sample\(s\), too few for 3 term"):
            fit_together(own, {"strain": x, "force": y}, POWERS, [made])


@pytest.mark.parametrize(
    ("long", "most", "recorded"),
    [(24, 0, [1, 2, 0]), (23, 3, [0, 1, 2]), (23, 2, None)],
)
def test_short_segments_are_sorted_and_the_order_of_long_ones_is_ignored(
    long, most, recorded, monkeypatch
):
    """Three samples have 24 bytes."""
    monkeypatch.setattr(segment_fit, "LONG", long)
    monkeypatch.setattr(segment_fit, "MOST", most)
    x = np.array([3.0, 1.0, 2.0])
    own = Segment("all/all", "all", (), np.arange(3))
    made = recipe(dictionary=("strain",))
    found = segment_fit._samples_of(own, {"strain": x, "force": -x}, ("strain",), made, None)
    assert found.y.tolist() == ([-1, -2, -3] if long == 24 else [-3, -1, -2])
    order = found.weighing.recorded
    assert (order if order is None else order.tolist()) == recorded


TERMS = products(["pressure", "strain"], 5)


def long_segment(n, **changes):
    rng = np.random.default_rng(0)
    samples = {"pressure": rng.uniform(0, 1, n), "strain": rng.uniform(0, 1, n)}
    samples["force"] = 3 * samples["pressure"] * (1 - samples["strain"]) ** 2 + rng.normal(
        0, 0.01, n
    )
    made = recipe(dictionary=tuple(map(to_text, TERMS)), scaling="none", max_terms=5, **changes)
    return Segment("all/all", "all", (), np.arange(n)), samples, made


@pytest.mark.parametrize("stop", ["tolerance", "bic"])
def test_blocks_of_the_dictionary_give_what_the_whole_gives(stop):
    n = 30_000
    segment, samples, made = long_segment(n, stop=stop)
    assert reads_once(n, len(TERMS), 5)
    ours = fit_together(segment, samples, TERMS, [made])[0].selection
    whole = frols(
        dictionary_matrix(TERMS, samples, n), samples["force"], 5, made.fit.tolerance, stop=stop
    )
    assert ours.chosen.tolist() == whole.chosen.tolist()
    assert ours.stop == whole.stop
    np.testing.assert_allclose(ours.theta, whole.theta, rtol=1e-9)
    np.testing.assert_allclose(ours.err_all, whole.err_all, rtol=1e-6)


def test_a_value_that_is_not_finite_is_found_in_any_block():
    n = 60_000
    segment, samples, made = long_segment(n)
    samples["strain"][41_234] = 2.0
    with pytest.raises(
        DataError,
        match=(
            r"segment all/all: the term `log\(1.5 - strain\)` is not finite in row \d+ "
            r"\(strain = 2\)"
        ),
    ):
        fit_together(segment, samples, [*TERMS, parse("log(1.5 - strain)")], [made])


@pytest.mark.parametrize("seed", range(6))
def test_five_outliers_move_a_segment_by_less_than_the_noise(seed):
    """The noise is 2. A start whose weights forget the scale of the residuals ends 6.6 off."""
    x, y = falling(seed)
    out = np.isin(np.arange(60), np.random.default_rng(seed).choice(60, 5, replace=False))
    whole, without = (
        fitted(x[rows], (y + 1000 * out)[rows], loss="bisquare", max_terms=3)
        for rows in (np.ones(60, dtype=bool), ~out)
    )
    inner = slice(*np.searchsorted(PLACES, (x[~out][0], x[~out][-1])))
    assert np.abs(whole - without)[inner].max() < 1.0


@pytest.mark.parametrize(
    ("n", "most", "counts", "columns"),
    [
        (7, 2, {3}, 3),
        (9, 1, {2, 3}, 2),
        (10, 1, {2, 3}, 6),
        (200, 1, {2, 6}, 6),
        (201, 1, {2, 6}, 0),
    ],
)
def test_outliers_are_sought_by_fits_of_few_and_of_many_terms(
    n, most, counts, columns, monkeypatch
):
    """With the constant, there are six candidates. In a short segment, each sample is compared with
    a fit of all of them to the other samples, or of the chosen ones if there are too few samples.
    """
    tried, sizes = set(), set()
    chosen, sought = segment_fit._chosen_terms, segment_fit.gross_outlier

    def choose(terms, scalings, outputs, made):
        if len(terms) == 6:
            tried.add(made.fit.max_terms)
        return chosen(terms, scalings, outputs, made)

    def seek(P, y):
        sizes.add(P.shape[1])
        return sought(P, y)

    monkeypatch.setattr(segment_fit, "_chosen_terms", choose)
    monkeypatch.setattr(segment_fit, "gross_outlier", seek)
    x = np.linspace(0, 0.25, n)
    y = 300 * (1 - 3 * x) + np.random.default_rng(n).normal(0, 0.3, n)
    fitted(x, y, loss="huber", max_terms=most, scaling="none", tolerance=0.0)
    assert tried == counts
    assert min(sizes, default=0) == columns


@pytest.mark.parametrize(("height", "hidden"), [(0.1, True), (300, False), (-300, False)])
def test_only_an_outlier_with_a_small_residual_is_weighed_by_a_fit_without_it(
    height, hidden, monkeypatch
):
    seen = []
    deleted = np.full(40, 0.5)
    monkeypatch.setattr(segment_fit, "gross_outlier", lambda _P, _y: (deleted, 20))
    monkeypatch.setattr(
        segment_fit, "loss_weights", lambda _loss, left: seen.append(left) or np.ones(40)
    )
    x, noise = np.linspace(0, 0.25, 40), np.random.default_rng(1).normal(0, 0.3, 40)
    y = 300 * (1 - 3 * x) + noise + height * (np.arange(40) == 20)
    fitted(x, y, loss="huber", scaling="none")
    assert {left is deleted for left in seen} == {hidden}


LONG = pytest.mark.long


@pytest.mark.parametrize(
    ("loss", "n", "terms"),
    [
        ("bisquare", 10, 3),
        pytest.param("bisquare", 14, 3, marks=LONG),
        ("huber", 10, 4),
        pytest.param("huber", 13, 4, marks=LONG),
        pytest.param("huber", 40, 4, marks=LONG),
    ],
)
def test_one_gross_outlier_in_a_segment_moves_it_no_more_than_its_absence(loss, n, terms):
    """At an end, a cubic passes through it: a robust loss alone does not see it."""
    x, noise = np.linspace(0, 0.25, n), np.random.default_rng(n).normal(0, 0.3, n)
    y, how = 300 * (1 - 3 * x) + noise, {"loss": loss, "max_terms": terms, "tolerance": 0.0}
    whole = fitted(x, y, **how)
    for place in range(n):
        rest = np.arange(n) != place
        inner = slice(*np.searchsorted(PLACES, (x[rest][0], x[rest][-1])))
        absent = np.abs(fitted(x[rest], y[rest], **how) - whole)[inner].max()
        bent = np.abs(fitted(x, y + 300.0 * ~rest, **how) - whole)[inner].max()
        assert bent < max(1.0, 2 * absent), place
