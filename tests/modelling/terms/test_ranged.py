"""Splines, ends and steps: candidate terms whose places and widths are parts of a training
range.
"""

from mapmore_cli.fitting.kinds.dictionary import terms_of
from mapmore_cli.modelling.expressions.ranged import placed
from mapmore_cli.study.sections.dictionary import DictionaryEntry

KNOTTED = [f"abs(strain - {place})^3" for place in (0.25, 0.5, 0.75)]


def written(family, **settings):
    """The terms of a family, before the range is known."""
    return terms_of([DictionaryEntry.model_validate({family: settings})])


def ends(widths, partners=()):
    return written("ends", of="strain", widths=widths, **{"with": list(partners)})


def along(texts, low, high, name="strain"):
    """The terms over a range."""
    return placed(tuple(texts), ((name, low, high),))


def test_on_a_unit_range_terms_are_short():
    spline = written("spline", of="strain", knots=3, **{"with": ["pressure"]})
    assert along(spline, 0, 1) == (
        *("1", "strain", "strain^2", "strain^3", *KNOTTED, "pressure"),
        *(f"pressure*{text}" for text in ("strain", "strain^2", "strain^3", *KNOTTED)),
    )
    assert along(ends([0.03], ["pressure^2"]), 0, 1)[1:3] == (
        "exp((strain - 1)/0.03)",
        "pressure^2*exp(-strain/0.03)",
    )
    assert along(written("steps", of="strain", count=3, widths=[0.1]), -1, 0) == (
        "tanh((strain + 1)/0.1)",
        "tanh((strain + 0.5)/0.1)",
        "tanh(strain/0.1)",
    )


def test_on_another_range_numbers_have_few_digits_and_one_divisor():
    assert along(ends([0.03]), 10.012, 840.013) == (
        "exp(-(strain - 10)/24.9)",
        "exp((strain - 840)/24.9)",
    )


def test_a_quantity_that_stays_has_a_width_of_one():
    assert along(["abs(unit(strain - 0.5))", "unit(strain)"], 3, 3) == (
        "abs(strain - 3)",
        "strain - 3",
    )


def test_a_step_times_the_change_and_its_square_over_every_window():
    factors = ["1", *(f"(x - x[k-{w}]){power}" for w in (4, 16) for power in ("", "^2")), "y"]
    found = along(
        written(
            "steps", of="x", count=2, widths=[0.1], window=[4, 16], **{"with": ["change", "y"]}
        ),
        0,
        1,
        name="x",
    )
    assert found == tuple(
        text.removeprefix("1*")
        for f in factors
        for text in (f"{f}*tanh(x/0.1)", f"{f}*tanh((x - 1)/0.1)")
    )


def test_products_take_them_as_any_other_family():
    of = [{"ends": {"of": "strain", "widths": [0.1]}}, "pressure"]
    texts = written("products", of=of, order=2, constant=False, **{"with": ["pressure"]})
    assert {
        "pressure",
        "exp(-strain/0.1)",
        "exp(-strain/0.1)*pressure",
        "exp((strain - 1)/0.1)^2",
    } <= set(along(texts, 0, 1))
    inside = written("products", of=[{"spline": {"of": "strain", "knots": 2}}, "pressure"], order=1)
    assert inside.count("1") == 1
