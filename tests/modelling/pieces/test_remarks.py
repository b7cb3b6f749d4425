"""What is told of pieces beyond the ends of their curves is so."""

import numpy as np
import pytest
from surfaces import QUANTITIES, curves, recipe

from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import Cuts


def notes(extrapolation, order=2, made=None):
    asked = recipe(
        dictionary=tuple(f"strain^{power}" for power in range(1, order + 1)),
        cuts={"strain": Cuts("even", 1)},
        max_terms=order,
        tolerance=0.0,
        extrapolation=extrapolation,
    )
    return " ".join(build("a", made or curves(), asked, QUANTITIES).notes)


def wriggling():
    """Curves of 100 and 300 kPa, the first of which is short and noisy."""
    rng = np.random.default_rng(0)
    for level, end in ((100.0, 0.05), (300.0, 0.25)):
        strain = np.linspace(0, end, 40)
        columns = {
            "pressure": np.full(40, level),
            "strain": strain,
            "force": level * (1 - 3 * strain) + rng.normal(0, 3, 40),
        }
        yield Curve(f"pressure={level:g}", level, columns, np.zeros(40, dtype=bool), ("a",))


@pytest.mark.parametrize(
    ("extrapolation", "order", "made", "said"),
    [
        (None, 2, curves, "the output is kept constant"),
        ("saturate", 2, curves, ""),
        ("continue_linear", 2, curves, ""),
        ("continue", 2, curves, ""),  # a parabola does not explode there
        (
            "continue",
            6,
            wriggling,
            "very large on pressure=100; write `fuse: {extrapolation: saturate}`",
        ),
        ("saturate", 6, wriggling, ""),
    ],
)
def test_only_what_happens_is_warned_of(extrapolation, order, made, said):
    told = notes(extrapolation, order, tuple(made()))
    assert said in told
    assert bool(said) == bool(told)
