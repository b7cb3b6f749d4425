"""FROLS of a record that never is in memory as a whole."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.modelling.frols import frols, frols_streamed


class Record:
    """Blocks of given lengths, and how often they were read."""

    def __init__(self, P, y, lengths):
        self.blocks = list(zip(np.split(P, np.cumsum(lengths)), np.split(y, np.cumsum(lengths)), strict=True))
        self.passes = 0

    def __call__(self):
        self.passes += 1
        return iter(self.blocks)


def powers(n, M, noise=0.1):
    rng = np.random.default_rng(n + M)
    x = rng.uniform(0, 1, n)
    P = np.column_stack([x**i for i in range(M)])
    return P, np.sin(5 * x) + 2 + noise * rng.normal(size=n)


@settings(max_examples=50)
@given(lengths=st.lists(st.integers(0, 6_000), max_size=6), M=st.integers(1, 8), stop=st.sampled_from(["tolerance", "bic", "press"]))
def test_any_cut_into_blocks_gives_what_the_whole_gives(lengths, M, stop):
    P, y = powers(sum(lengths) + 50, M)
    whole, cut = frols(P, y, 4, stop=stop), frols_streamed(Record(P, y, lengths), 4, stop=stop)
    assert cut.chosen.tolist() == whole.chosen.tolist()
    assert cut.stop == whole.stop
    assert cut.samples == len(y)
    np.testing.assert_allclose(cut.err, whole.err, rtol=1e-7)
    np.testing.assert_allclose(cut.theta, whole.theta, rtol=1e-7)
    np.testing.assert_allclose(cut.theta_error, whole.theta_error, rtol=1e-7)
    assert cut.sse == pytest.approx(whole.sse, rel=1e-9)


@pytest.mark.parametrize(
    ("kind", "stop", "passes"),
    [
        ("ordinary", "tolerance", 1),
        ("ordinary", "bic", 1),
        ("ordinary", "press", 2),
        ("dependent", "tolerance", 2),
        ("noise-free", "tolerance", 2),
        ("squares vanish", "tolerance", 3),
    ],
)
def test_the_record_is_read_as_seldom_as_possible(kind, stop, passes):
    P, y = powers(10_000, 4)
    if kind == "dependent":
        P[:, 3] = 2 * P[:, 0]
    elif kind == "noise-free":
        y = 3 * P[:, 1]
    elif kind == "squares vanish":
        P *= 1e-170
    record = Record(P, y, [3_000, 3_000])
    frols_streamed(record, 3, stop=stop)
    assert record.passes == passes


def test_memory_does_not_grow_with_the_record():
    def blocks(count):
        def start():
            rng = np.random.default_rng(0)
            for _ in range(count):
                P = rng.normal(size=(5_000, 8))
                yield P, P[:, 0] + rng.normal(size=5_000)

        return start

    peaks = []
    for count in (4, 40):
        tracemalloc.start()
        assert frols_streamed(blocks(count), 3).samples == 5_000 * count
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


def test_other_number_types_are_taken_as_doubles():
    P, y = np.arange(24).reshape(8, 3) % 7, np.arange(8)
    ours, reference = frols_streamed(Record(P, y, [3]), 2), frols(P, y, 2)
    np.testing.assert_allclose(ours.theta, reference.theta)


@pytest.mark.parametrize(
    "blocks",
    [
        pytest.param([], id="no block"),
        pytest.param([(np.empty((0, 3)), np.empty(0))], id="no row"),
        pytest.param([(np.empty((4, 0)), np.ones(4))], id="no column"),
        pytest.param([(np.ones((4, 3)), np.ones(5))], id="lengths differ"),
        pytest.param([(np.ones((4, 3)), np.ones(4)), (np.ones((4, 2)), np.ones(4))], id="columns differ"),
        pytest.param([(np.ones(4), np.ones(4))], id="not a matrix"),
    ],
)
def test_blocks_that_do_not_fit(blocks):
    with pytest.raises(ValueError, match="must be"):
        frols_streamed(lambda: blocks, 2)


def test_unknown_rules_are_refused_before_anything_is_read():
    def unread():
        raise AssertionError("was read")

    with pytest.raises(ValueError, match="unknown stop rule 'aic'"):
        frols_streamed(unread, 2, stop="aic")
    with pytest.raises(ValueError, match="max_terms"):
        frols_streamed(unread, 0)
