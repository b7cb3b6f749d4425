"""Prices and values that a person gives to `plan` and `tune`."""

import pytest

from mapmore_cli.annexes.planning.commands import _prices_of, _values_of
from mapmore_cli.domain.errors import UsageError


def test_prices_are_above_zero():
    assert _prices_of("pressure=1, strain = 2.5") == {"pressure": 1, "strain": 2.5}
    assert _prices_of(None) == _prices_of("") == {}
    for text in ("pressure", "pressure=x", "pressure=0", "pressure=-1", "a=inf", "a=nan", "a=1,b"):
        with pytest.raises(UsageError, match=r"--cost .* is not of the form"):
            _prices_of(text)


def test_values_of_settings_are_yaml():
    values = _values_of(["fit.max_terms=2,4", " fit.stop =bic", "a=[1, 2],true"])
    assert values == {"fit.max_terms": [2, 4], "fit.stop": ["bic"], "a": [[1, 2], True]}
    for text in ("fit", "=1", "fit.=1", "a=", "a=1]"):
        with pytest.raises(UsageError, match="--over"):
            _values_of([text])
    with pytest.raises(UsageError, match="given twice"):
        _values_of(["a=1", "a=2"])
