"""The rule of one standard error, against its own words."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmore_cli.modelling.validation.significance import simplest_of

TABLES = st.tuples(st.integers(1, 6), st.integers(2, 5)).flatmap(
    lambda shape: st.tuples(
        st.lists(st.integers(1, 9), min_size=shape[0], max_size=shape[0]), arrays(np.float64, shape, elements=st.floats(0.0, 8.0, width=16))
    )
)


@given(TABLES)
def test_none_that_is_simpler_is_as_good(table: tuple[list[int], np.ndarray]) -> None:
    sizes, errors = table
    found = simplest_of(sizes, errors)
    assert errors[found.best].mean() == errors.mean(axis=1).min()
    assert sizes[found.chosen] <= sizes[found.best]
    for number, size in enumerate(sizes):
        above = errors[number] - errors[found.best]
        standard_error = np.sqrt(np.sum((above - above.mean()) ** 2) / (len(above) - 1) / len(above))
        if number == found.chosen:
            assert above.mean() <= standard_error + 1e-12
        elif size < sizes[found.chosen]:
            assert above.mean() > standard_error - 1e-12


@given(TABLES, st.randoms())
def test_the_order_of_folds_is_of_no_consequence(table: tuple[list[int], np.ndarray], shuffle: object) -> None:
    sizes, errors = table
    order = np.random.default_rng(shuffle.randint(0, 99)).permutation(errors.shape[1])  # type: ignore[attr-defined]
    a, b = simplest_of(sizes, np.round(errors)), simplest_of(sizes, np.round(errors)[:, order])  # integers add up in any order
    assert (a.best, a.chosen) == (b.best, b.chosen)


def test_what_lies_at_the_bound_is_within_in_any_order_of_folds() -> None:
    errors = np.array([[3.0, 6, 6, 6, 6], [6.0, 6, 6, 6, 6], [6.0, 0, 0, 6, 6]])  # mean and standard error of the excess are both 1.8
    assert {simplest_of([1, 1, 2], errors[:, order]).chosen for order in ([0, 1, 2, 3, 4], [4, 3, 2, 1, 0], [1, 2, 0, 4, 3])} == {0}


def test_what_is_hard_for_all_models_decides_nothing() -> None:
    errors = np.array([[10.0, 1.2, 5.1], [9.9, 1.0, 5.0]])  # the larger model is better on every fold
    assert simplest_of([1, 2], errors).chosen == 1
