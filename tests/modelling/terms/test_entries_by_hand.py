"""The terms of each entry of a dictionary, in order, by hand."""

from math import inf
from types import SimpleNamespace

import pytest

from mapmore_cli.checking.rules.fits import _most_terms
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.recording import Signal
from mapmore_cli.fitting.kinds.dictionary import bounds_of, signal_of, terms_of
from mapmore_cli.study.sections.data import Direction, Rate
from mapmore_cli.study.sections.dictionary import DictionaryEntry, numbers_of


def entry(**settings):
    return DictionaryEntry.model_validate(settings)


def polynomial(*of, order=1, **more):
    return {"polynomial": {"of": list(of), "order": order, **more}}


@pytest.mark.parametrize(
    ("settings", "terms"),
    [
        (polynomial("x", order=2), "1 x x^2"),
        (polynomial("x", "x", "y", constant=False), "x y"),
        ({"lags": {"of": ["x"], "steps": [1, 2, 1], "order": 1}}, "1 x[k-1] x[k-2]"),
        ({"products": {"of": ["x", polynomial("y")], "order": 1}}, "1 x y"),
        ({"products": {"of": ["x", "y"], "order": 1, "constant": False}}, "x y"),
        # the constant of a family inside products is left out, and so is that of inner products
        ({"products": {"of": [{"products": {"of": ["x"], "order": 1}}], "order": 1,
            "constant": False}}, "x"),
        ({"terms": ["x*2", "y"]}, "2*x y"),
    ],
)  # fmt: skip
def test_terms_of_an_entry(settings, terms):
    assert [*terms_of([entry(**settings)])] == terms.split()


def test_terms_of_several_entries_occur_once_and_partners_are_among_them():
    assert terms_of([entry(**polynomial("x")), entry(**polynomial("y", "x"))]) == ("1", "x", "y")
    with pytest.raises(SpecError, match="`z` of `with` is not one of the terms"):
        terms_of([entry(products={"of": ["x"], "order": 2, "with": ["z"]})])
    assert bounds_of([entry(**polynomial("x"))]) == {}
    for sign, limits in (("positive", (0, inf)), ("negative", (-inf, 0))):
        assert bounds_of([entry(**polynomial("x"), sign=sign)]) == {"1": limits, "x": limits}


@pytest.mark.parametrize(("of", "most"), [(["x"], 2), (["x", "y", "z"], 3), ([], 3)])
def test_a_segment_has_no_more_terms_than_the_dictionary(of, most):
    dictionary = [entry(**polynomial(*of))] if of else []
    spec = SimpleNamespace(fit=SimpleNamespace(max_terms=3), dictionary=dictionary)
    assert _most_terms(SimpleNamespace(spec=spec)) == most


def test_numbers_of_states_are_given_or_spread():
    """Of time constants, from ten steps to a quarter of the longest piece."""

    def numbers(**settings):
        entry = DictionaryEntry.model_validate({"slow": {"of": ["x"], **settings}})
        return [*numbers_of("slow", entry.slow, 0.01, 40.0)]

    assert numbers(tau=[0.5, 2.0]) == [(0.5,), (2.0,)]
    assert numbers(count=3) == [(0.1,), (1.0,), (10.0,)]
    assert numbers() == []


def test_a_rate_knows_the_unit_of_its_clock():
    units = {"x": "mm", "time": "ms", "v": "m/s"}
    rate = signal_of("v", Rate(rate_of="x", window=0.2, order=2), units)
    assert rate == Signal("v", "rate", "x", window=0.2, order=2, factor=1e-3, seconds=1e-3)
    sign = signal_of("v", Direction(direction_of="x", dead_band=0.5), units)
    assert sign == Signal("v", "direction", "x", dead_band=0.5)
