"""Segments so long that their dictionary is made block by block."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from surfaces import QUANTITIES, curves, recipe

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Segment
from mapmore_cli.modelling.expressions import dictionary_matrix, parse, to_text
from mapmore_cli.modelling.expressions.families import products
from mapmore_cli.modelling.frols import frols, reads_once
from mapmore_cli.modelling.pieces import fit as regression
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.fit import fit_segment

TERMS = products(["pressure", "strain"], 5)


def long_segment(n, **changes):
    rng = np.random.default_rng(0)
    samples = {"pressure": rng.uniform(0, 1, n), "strain": rng.uniform(0, 1, n)}
    samples["force"] = 3 * samples["pressure"] * (1 - samples["strain"]) ** 2 + rng.normal(0, 0.01, n)
    made = recipe(dictionary=tuple(map(to_text, TERMS)), scaling="none", max_terms=5, **changes)
    return Segment("all/all", "all", (), np.arange(n)), samples, made


@pytest.mark.parametrize("stop", ["tolerance", "bic", "press"])
def test_blocks_of_the_dictionary_give_what_the_whole_gives(stop):
    n = 30_000
    segment, samples, made = long_segment(n, stop=stop)
    assert reads_once(n, len(TERMS), 5)
    ours = fit_segment(segment, samples, TERMS, made).selection
    whole = frols(dictionary_matrix(TERMS, samples, n), samples["force"], 5, made.fit.tolerance, stop=stop)
    assert ours.chosen.tolist() == whole.chosen.tolist()
    assert ours.stop == whole.stop
    np.testing.assert_allclose(ours.theta, whole.theta, rtol=1e-9)
    np.testing.assert_allclose(ours.err_all, whole.err_all, rtol=1e-6)


def test_the_dictionary_is_never_there_as_a_whole():
    n = 200_000
    segment, samples, made = long_segment(n)
    tracemalloc.start()
    fit_segment(segment, samples, TERMS, made)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.6 * n * len(TERMS) * 8  # its columns sorted, and scaled: twelve of the dictionary's 21


def test_a_wide_dictionary_is_read_as_a_whole(monkeypatch):
    monkeypatch.setattr(regression, "frols_streamed", None)
    model = build("short", curves(), recipe(), QUANTITIES)
    assert all(curve.segments for curve in model.body.curves)


def test_a_value_that_is_not_finite_is_found_in_any_block():
    n = 60_000
    segment, samples, made = long_segment(n)
    samples["strain"][41_234] = 2.0
    with pytest.raises(DataError, match=r"segment all/all: the term `log\(1.5 - strain\)` is not finite in row \d+ \(strain = 2\)"):
        fit_segment(segment, samples, [*TERMS, parse("log(1.5 - strain)")], made)
