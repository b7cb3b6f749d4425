"""Results of fits: what they say of themselves, by hand."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from mapmore_cli.domain.fits import Identified, StateSet
from mapmore_cli.domain.models import KeptShape, Shape

STATES = StateSet(("u",), 0.1, {}, {}, low=np.empty(0), high=np.empty(0), margin=0.1)


@pytest.mark.parametrize(("ordered", "longest"), [(False, 0.1), (True, inf)])
def test_a_memory_that_counts_only_the_order_has_no_gaps(ordered, longest):
    assert replace(STATES, ordered=ordered).longest_step == longest


def test_numbers_at_a_bound_of_their_search_are_noted():
    numbers, held = np.array([0.5, 2.0]), np.array([False, True])
    (note,) = Identified(("tau", "width"), numbers, np.ones(2), held).notes
    assert note.startswith("width = 2 lies at a bound of its search")


def test_a_shape_is_monotone_along_the_inputs_that_rise_or_fall():
    words = {"p": "increasing", "s": "decreasing", "x": "convex", "y": "positive"}
    kept = tuple(KeptShape(name, word, 0.0, {}) for name, word in words.items())
    shape = Shape(kept, slack=0.05, beyond=0.1)
    assert shape.monotone == {"p", "s"}
    assert shape.promise.startswith(
        "increasing in p, decreasing in s, convex in x, positive over the training range"
    )
