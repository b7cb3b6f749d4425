"""How many samples and inputs black boxes of a search get."""

from types import SimpleNamespace

import numpy as np
import pytest
from common import dataset_of

from mapmore_cli.annexes.search import black_boxes as module
from mapmore_cli.annexes.search.black_boxes import black_boxes, smooth
from mapmore_cli.modelling.learners import LEARNERS

pytest.importorskip("sklearn")


@pytest.mark.parametrize(
    ("n", "inputs", "learners"),
    [
        *((99, 1, ["gaussian process"]), (100, 4, ["gaussian process", "gradient boosting"])),
        *((100, 5, ["gradient boosting"]), (99, 5, []), (5000, 1, ["gaussian process"])),
    ],
)
def test_learners_of_a_fold_get_no_more_samples_than_they_bear(n, inputs, learners, monkeypatch):
    asked = {}

    def learner(name, x, y):
        asked[name] = len(y)
        return lambda at: np.zeros(len(at))

    monkeypatch.setattr(module, "smooth", lambda x, y: learner("gaussian_process", x, y))
    monkeypatch.setattr(module, "learned", learner)
    names = [f"x{place}" for place in range(inputs)]
    columns = {name: np.linspace(0.0, 1.0, n) for name in names}
    dataset = dataset_of({**columns, "y": np.ones(n)})
    out = np.arange(n) < 10
    found = black_boxes(dataset, [out], SimpleNamespace(inputs=names, timed=False, ordered=False))
    assert [tried.words for tried, _ in found][: len(learners)] == learners
    for _, (missed,) in found:
        np.testing.assert_array_equal(missed, -np.ones(10))
    for name, samples in asked.items():
        most = LEARNERS[name].most_samples // 2
        assert samples <= most
        assert samples == n - 10 or samples > most // 2
    assert black_boxes(dataset, [out], SimpleNamespace(inputs=[], timed=False, ordered=False)) == []


def test_a_process_does_not_depend_on_the_range_of_its_inputs():
    x = np.linspace(0.0, 1.0, 12)
    constant = np.full(12, 3.0)
    plain = smooth(np.column_stack([x, constant]), np.sin(3 * x))
    other = smooth(np.column_stack([1e4 * x - 7, constant]), np.sin(3 * x) + 50)
    at = np.linspace(0.1, 0.9, 5)
    there = np.full(5, 3.0)
    near = plain(np.column_stack([at, there]))
    np.testing.assert_allclose(near, np.sin(3 * at), atol=0.01)
    np.testing.assert_allclose(other(np.column_stack([1e4 * at - 7, there])), near + 50, atol=1e-6)
