"""What is told of pieces beyond the ends of their curves is so."""

import numpy as np
import pytest
from common import curve_of
from surfaces import QUANTITIES, curves, joined, recipe

from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.remarks import exploding_curves


def notes(extrapolation, order, made):
    asked = recipe(
        dictionary=tuple(f"strain^{power}" for power in range(1, order + 1)),
        cuts={"strain": Cuts("even", 1)},
        max_terms=order,
        tolerance=0.0,
        extrapolation=extrapolation,
    )
    return " ".join(build("a", made, asked, QUANTITIES).notes)


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
        (None, 1, curves, ""),
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


@pytest.mark.parametrize(("power", "told"), [(7, []), (8, ["a"])])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_curve_explodes_beyond_one_and_a_half_ranges_from_the_middle(power, told, sign):
    """A tenth of the range beyond the samples, `x^7` is 1.95 and `x^8` is 2.14; the limit is 2."""
    x = np.linspace(0, 1, 50)
    samples = curve_of({"x": x, "y": sign * (x**power + 1e-3 * x)})
    asked = recipe(target="y", level=None, cuts={}, dictionary=("x", f"x^{power}"), max_terms=2,
                   tolerance=0.0, scaling="none", extrapolation="continue")  # fmt: skip
    model = build("a", [samples], asked, {name: Quantity(name, "1") for name in "xy"})
    assert exploding_curves(model, [samples], "y") == told
    held = joined(model, extrapolation={"x": ("saturate", "saturate")})
    assert exploding_curves(held, [samples], "y") == []


def test_one_segment_with_several_terms_decides_for_its_curve_and_one_input_for_the_model():
    """The segment on the left has one term; only along x does the curve continue."""
    x = np.linspace(0, 1, 101)
    line, steep = 1e-3 * x, np.where(x > 0.5, x**8, 0)
    samples = curve_of({"x": x, "z": np.cos(40 * x), "y": line + steep})
    asked = {"target": "y", "level": None, "cuts": {"x": Cuts("breakpoints", at=(0.505,))},
             "dictionary": ("x", "x^8", "z"), "max_terms": 2, "tolerance": 0.0,
             "scaling": "none"}  # fmt: skip
    quantities = {name: Quantity(name, "1") for name in "xyz"}
    plain = build("a", [samples], recipe(**asked), quantities)
    assert [len(one.terms) for one in plain.body.segments] == [1, 2]
    assert plain.body.fusion.extrapolation["x"] == ("saturate", "saturate")
    assert "the output is kept constant" in plain.notes[-1]
    sides = {"x": ("continue", "continue"), "z": ("saturate", "saturate")}
    assert exploding_curves(joined(plain, extrapolation=sides), [samples], "y") == ["a"]
