"""Published identification records, beside what a peer library selected; skipped where they are not
installed.
"""

import json
import re

import numpy as np
import pytest
from memory_samples import recipe_of, record, rrse, texts

from mapmore_cli.modelling.expressions.families import lags
from mapmore_cli.modelling.memory.fitting import fit_with_memory
from mapmore_cli.modelling.memory.free_run import Along


@pytest.fixture(scope="module")
def folder(measured_data):
    return measured_data / "system_identification"


@pytest.fixture(scope="module")
def peer(folder):
    return json.loads((folder / "peer_sysidentpy.json").read_text())["runs"]


def narx(terms):
    return recipe_of("y", texts(lags(["y", "x"], (1, 2)), 2), 1.0, max_terms=terms)


def in_our_words(term):
    """The peer's `y(k-2)y(k-1)` as `y[k-1]*y[k-2]`."""
    factors = [
        f"{name}[k-{step}]" + square
        for name, step, square in re.findall(r"([xy])1?\(k-(\d)\)(\^2)?", term)
    ]
    return "*".join(sorted(factors)) or "1"


def scored(fit, columns):
    run = Along(fit.model)(columns)
    assert run.diverged == ()
    return rrse(columns["y"], run.values), rrse(
        columns["y"], Along(fit.model, ahead=True)(columns).values
    )


def test_the_buck_converter_beside_the_peer(folder, peer):
    training, validation = (
        np.loadtxt(folder / f"buck_{name}.csv", delimiter=",", skiprows=1).T[1:]
        for name in ("id", "valid")
    )
    for terms in (8, 4):
        theirs = peer[f"buck_deg2_lag2_n{terms}"]
        fit = fit_with_memory([record(x=training[0], y=training[1])], narx(terms))
        assert list(fit.model.terms) == [in_our_words(term) for term, _, _ in theirs["terms"]]
        np.testing.assert_allclose(fit.model.theta, theirs["theta"], rtol=1e-6)
        np.testing.assert_allclose(fit.selection.err, theirs["err"][:terms], rtol=1e-6)
        free, one_step = scored(fit, dict(zip("xy", validation, strict=True)))
        assert free == pytest.approx(theirs["rrse_free"], rel=1e-6)
        assert one_step == pytest.approx(theirs["rrse_one"], rel=1e-6)
