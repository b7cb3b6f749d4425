"""Options for tables of other programs, and remedies that name them."""

import pytest

from mapmore_cli.cli.table_options import BY_OPTIONS, remedies_by_options, table_options
from mapmore_cli.domain.errors import DataError, UsageError


def test_options_become_what_a_reader_is_asked():
    columns = ["pressure = P [bar]", "strain=2", "load=a=b"]
    options = table_options(";", ",", None, "two", columns, ["pressure=bar, strain=%", "load=kg"])
    assert options.settings == {"delimiter": ";", "decimal": ",", "sheet": "two"}
    assert options.columns == {"pressure": "P [bar]", "strain": 2, "load": "a=b"}
    assert options.units == {"pressure": "bar", "strain": "%", "load": "kg"}
    bare = table_options(None, None, ".", None, [], [])
    assert (bare.settings, bare.columns, bare.units) == ({"thousands": "."}, {}, {})


@pytest.mark.parametrize("text", ["pressure", "=bar", "pressure=", " = "])
def test_a_pair_has_a_name_and_a_value(text):
    with pytest.raises(UsageError, match="is not of the form NAME=") as error:
        table_options(None, None, None, None, [], [text])
    assert error.value.remedy == "write `--units pressure=bar`"
    with pytest.raises(UsageError) as error:
        table_options(None, None, None, None, [text], [])
    assert error.value.remedy == "write `--columns pressure='P [bar]'`"


@pytest.mark.parametrize("remedy", ["say `decimal: ,`", None])
def test_remedies_name_options(remedy):
    with pytest.raises(DataError) as error, remedies_by_options():
        raise DataError("a", remedy)
    first, _, last = error.value.remedy.rpartition("\n  ")
    assert (first, last) == (remedy or "", BY_OPTIONS)
