"""Noise-free records made by a known structure are explained to the last digits, by a structure of its kind and no larger than needed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.domain.search import Search
from mapmore_cli.fitting import searching
from mapmore_cli.fitting.search_bench import Slice
from mapmore_cli.fitting.searching import search
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.modelling.search.families import autoregression as autoregression_family
from mapmore_cli.spec.sections.model import ModelChoice

Columns = dict[str, np.ndarray]
STEP = 0.02


def surface(rng: np.random.Generator) -> Columns:
    """A quadratic of two inputs."""
    x, z = rng.uniform(0, 1, (2, 80))
    a = rng.uniform(0.5, 2, 4)
    return {"x": x, "z": z, "y": a[0] + a[1] * x - a[2] * x * z + a[3] * z**2}


def autoregression(rng: np.random.Generator) -> Columns:
    """Two delays of the output and one product, driven by steps of random height."""
    u = np.repeat(rng.uniform(-1, 1, 50), 12)
    y, a = np.zeros(len(u)), rng.uniform(0.05, 0.15, 2)
    for k in range(2, len(u)):
        y[k] = 1.2 * y[k - 1] - 0.5 * y[k - 2] + a[0] * u[k - 1] + a[1] * u[k - 1] * y[k - 1]
    return {"time": STEP * np.arange(len(u)), "u": u, "y": y}


def found(columns: Columns) -> Search:
    curve = Curve("a", None, columns, np.zeros(len(columns["y"]), dtype=bool), ("a",))
    dataset = Dataset("y", None, {name: Quantity(name, "1") for name in columns}, (), (curve,))
    return search(dataset, Slice(None, ModelChoice(type="auto"), Fuse(), {}, None, (), False))


CASES = ((surface, "surface of order 2"), (autoregression, "two delays of the output, order 2"))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("make", "words"), CASES)
def test_a_noise_free_record_is_explained_by_a_structure_of_its_kind(
    make: Callable[[np.random.Generator], Columns], words: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = {name: searching.FAMILIES[name] for name in ("surface", "steep", "autoregression")}
    monkeypatch.setattr(searching, "FAMILIES", few)
    monkeypatch.setattr(autoregression_family, "MOST_SELECTED", 0)  # what is chosen in free run takes long
    monkeypatch.setattr(searching, "black_boxes", lambda *_: {})
    taken = found(make(np.random.default_rng(seed))).found
    assert taken.words.startswith(words)
    assert taken.parameters <= 6  # four, in coordinates that are not shifted
    assert taken.error < 1e-9
