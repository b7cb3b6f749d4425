"""The tables of docs/search.md: their summaries follow from their rows, which
`docs/search_tables.py` and `docs/search_draws.py` make.
"""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import search_draws
import yaml
from common import dataset_of
from page_tables import rows_of

from mapmore_cli.study.loader import load

PAGE = Path(__file__).parents[2] / "docs" / "search.md"


@pytest.mark.parametrize(
    "path", sorted((PAGE.parent / "search").glob("*.yaml")), ids=lambda path: path.stem
)
def test_a_minimal_spec_of_the_page_says_nothing_of_a_structure(path):
    spec = load(path).spec
    assert spec.model.type == "auto"
    assert spec.name == path.stem
    assert not spec.dictionary


def test_the_summary_of_drawn_splits_follows_from_their_rows():
    made = search_draws.summary(search_draws.kept_rows())
    assert [list(row) for row in made.shown] == rows_of("drawn_summary", PAGE)[-len(made.rows) :]
    assert sum(row[4] for row in made.rows if row[3] == "all") == len(search_draws.kept_rows())


def test_a_drawn_band_holds_samples(monkeypatch):
    """Also where an input has few values, so that the first band that is drawn lies between two."""
    lengths = np.arange(0.0, 10.5, 1.5)
    table = dataset_of({"length": lengths, "force": np.arange(7.0)}, output="force")
    slice_of = SimpleNamespace(ignored=())
    monkeypatch.setattr(search_draws, "shipped", lambda *_: SimpleNamespace(spec=None))
    monkeypatch.setattr(search_draws, "search_slice", lambda _: slice_of)
    for seed in range(5):
        rng, same = np.random.default_rng(seed), np.random.default_rng(seed)
        split = search_draws._split("fmax_by_length", "band", "table", table, rng)
        (bands,) = yaml.safe_load(split).values()
        for low, high in bands["between"]:
            assert ((low <= lengths) & (lengths <= high)).any()
        same.uniform(size=int(same.integers(1, 4)))
        assert rng.random() == same.random()  # what is drawn later does not depend on the bands
