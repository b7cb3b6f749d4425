"""What is held out has no say: turned round, it changes no byte of what is fitted or chosen."""

import numpy as np
import pytest
import unseen_tables
from page_tables import DOCS, rows_of
from unseen_tables import COLUMNS, KINDS, SAME, cell, splits_of

SLOW = ("search", "optimal", "auto", "hinged")
QUICK = [kind for kind in KINDS if not any(word in kind for word in SLOW)]


@pytest.mark.parametrize("kind", QUICK)
def test_one_split_of_every_kind(kind):
    """Kinds in turn have splits in turn."""
    splits = splits_of(kind)
    assert cell(kind, splits[QUICK.index(kind) % len(splits)]) == SAME


@pytest.mark.parametrize("split", ["fraction", "between"])
@pytest.mark.parametrize("kind", ["memory", "memory, stop: free_run"])
def test_a_held_out_output_is_not_the_past_of_a_training_sample(kind, split):
    assert cell(kind, split) == SAME


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_every_split(kind):
    assert {cell(kind, split) for split in splits_of(kind)} == {SAME}


def test_the_page_has_every_kind_and_every_cell_is_the_same():
    rows = {row[0]: row[1:] for row in rows_of("unseen", DOCS / "search.md")}
    assert set(rows) == set(KINDS)
    for kind, cells in rows.items():
        known = [name in splits_of(kind) for name in COLUMNS]
        assert [text.strip() == SAME for text in cells] == known


def test_what_has_seen_held_out_data_is_noticed(monkeypatch):
    def everything(_kind, dataset):
        return np.concatenate([c.columns[dataset.target] for c in dataset.curves]).tobytes()

    monkeypatch.setattr(unseen_tables, "made", everything)
    assert cell("pieces", "last") == unseen_tables.SEEN
